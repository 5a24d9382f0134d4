//! What the user gets when the network or the controller fails: one test per fault.
//!
//! Everywhere: the fault is named in the tick in which it shows, commands are refused from then on, the
//! commanded joints do not jump, and nothing moves again unless asked to.

mod connecting;
#[path = "../support/mod.rs"]
mod support;

use std::time::{Duration, Instant};

use palpate_robot_io::{BackendError, FaultKind, JointCommand, RobotBackend, RobotState};
use palpate_ur::{UrArm, UrError};
use support::{Controller, Fault};

/// rad per tick: 0.5 rad/s.
const STEP: f64 = 0.001;

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn moving(controller: &Controller) -> Result<(UrArm, RobotState), UrError> {
    let mut arm = UrArm::connect(controller.config())?;
    let mut state = arm.read()?;
    for _ in 0..30 {
        state = step(&mut arm, &state)?;
    }
    controller.lock().largest_step = 0.0;
    Ok((arm, state))
}

fn step(arm: &mut UrArm, state: &RobotState) -> Result<RobotState, UrError> {
    let mut q = state.q_target;
    q[5] += STEP;
    arm.write(&JointCommand { q })?;
    arm.read()
}

/// Moves until something fails.
fn until_error(arm: &mut UrArm, mut state: RobotState) -> UrError {
    for _ in 0..2000 {
        match step(arm, &state) {
            Ok(next) => state = next,
            Err(error) => return error,
        }
    }
    panic!("nothing failed");
}

/// The arm refuses to move, has come to rest without a jump, and stays there.
fn rests(controller: &Controller, arm: &mut UrArm) {
    let q = controller.lock().q;
    let refused = arm.write(&JointCommand { q: q.into() });
    assert!(matches!(refused, Err(UrError::Stopped)), "{refused:?}");
    let start = controller.lock().tick;
    controller.until(|w| w.tick > start + 60);
    let (goal, tick) = controller.see(|w| (w.target, w.tick));
    controller.until(|w| w.tick > tick + 60);
    let world = controller.lock();
    assert_eq!(world.target, goal, "the arm still moves");
    // A busy computer may send two set-points between two cycles; a jump is more than that.
    assert!(world.largest_step < 12.0 * STEP, "the target jumped by {} rad", world.largest_step);
}

/// After `recover` the arm waits for a command, and then follows it from where it is.
fn goes_on(controller: &Controller, arm: &mut UrArm) -> Outcome {
    let moved = controller.lock().moving_ticks;
    arm.recover()?;
    let mut state = arm.read()?;
    for _ in 0..20 {
        state = arm.read()?;
    }
    assert_eq!(controller.lock().moving_ticks, moved, "it moved without a command");
    for _ in 0..10 {
        state = step(arm, &state)?;
    }
    assert!(controller.lock().moving_ticks > moved);
    Ok(())
}

#[test]
fn a_cut_connection() -> Outcome {
    let controller = Controller::start(1.0);
    let (mut arm, state) = moving(&controller)?;
    controller.set(Fault::Cut);
    let error = until_error(&mut arm, state);
    assert_eq!(error.kind(), FaultKind::Link, "{error}");
    rests(&controller, &mut arm);
    // Still lost, and says so at once instead of returning old data.
    assert!(matches!(arm.read(), Err(UrError::NotConnected)));
    goes_on(&controller, &mut arm)?;
    // The program was still there: it was not loaded again.
    assert_eq!(controller.see(|w| (w.setups, w.uploads)), (2, 1));
    Ok(())
}

#[test]
fn a_pulled_cable() -> Outcome {
    let controller = Controller::start(1.0);
    let (mut arm, state) = moving(&controller)?;
    controller.set(Fault::Dead);
    let begin = Instant::now();
    let error = until_error(&mut arm, state);
    assert!(matches!(error, UrError::Stalled { .. }), "{error}");
    // 100 ticks in these tests, and what a busy computer adds.
    assert!(begin.elapsed() < Duration::from_millis(800), "{:?}", begin.elapsed());
    // The control program braked by itself.
    controller.until(|w| w.out[26] == 6);
    rests(&controller, &mut arm);
    controller.set(Fault::None);
    goes_on(&controller, &mut arm)
}

/// With the default of five ticks the PC's side knows after 10 ms.
#[test]
fn five_missing_samples_are_a_lost_link() -> Outcome {
    let controller = Controller::start(1.0);
    let mut arm = UrArm::connect(controller.config())?;
    arm.read()?;
    drop(arm);
    let mut config = controller.config();
    config.stale_ticks = 5;
    let mut arm = UrArm::observe(config)?;
    // A busy computer may miss the deadline honestly before the fault: only what follows it counts.
    let _ = arm.read();
    controller.set(Fault::Silent(400));
    let deadline = Instant::now() + Duration::from_secs(5);
    loop {
        let begin = Instant::now();
        if let Err(UrError::Stalled { waited }) = arm.read() {
            assert_eq!(waited, Duration::from_millis(10));
            assert!(begin.elapsed() >= Duration::from_millis(10));
            return Ok(());
        }
        assert!(Instant::now() < deadline, "the silence was not noticed");
    }
}

#[test]
fn a_short_silence_is_bridged_and_counted() -> Outcome {
    let controller = Controller::start(1.0);
    let mut arm = UrArm::connect(controller.config())?;
    arm.read()?;
    let before = arm.stats().missed;
    controller.set(Fault::Silent(4));
    for _ in 0..60 {
        arm.read()?;
    }
    assert!(arm.stats().missed >= before + 4, "{:?}", arm.stats());
    Ok(())
}

#[test]
fn a_controller_that_does_not_hear_us() -> Outcome {
    let controller = Controller::start(1.0);
    let (mut arm, state) = moving(&controller)?;
    controller.set(Fault::Deaf);
    let error = until_error(&mut arm, state);
    // Its own watchdog after 10 cycles, or ours after 100 ticks: both name the cause.
    assert!(matches!(error, UrError::Braked(_) | UrError::NotHeard { .. }), "{error}");
    rests(&controller, &mut arm);
    controller.set(Fault::None);
    goes_on(&controller, &mut arm)
}

#[test]
fn a_computer_that_hangs() -> Outcome {
    let controller = Controller::start(1.0);
    let (mut arm, state) = moving(&controller)?;
    std::thread::sleep(Duration::from_millis(300));
    // The newest sample, not the 150 that queued up; and the program has braked meanwhile.
    let error = step(&mut arm, &state).unwrap_err();
    assert_eq!(error.kind(), FaultKind::Timing, "{error}");
    let age = controller.lock().time - arm.sample().timestamp;
    assert!(age < 0.05, "the sample is {age} s old");
    assert!(arm.stats().skipped >= 50, "{:?}", arm.stats());
    rests(&controller, &mut arm);
    goes_on(&controller, &mut arm)
}

#[test]
fn split_and_merged_packets_change_nothing() -> Outcome {
    for fault in [Fault::Split, Fault::Merge(3), Fault::Repeat, Fault::Texts(20)] {
        let controller = Controller::start(1.0);
        // Split packets keep the controller busy: leave it time.
        let mut config = controller.config();
        config.stall_ticks = 100;
        let mut arm = UrArm::connect(config)?;
        let mut state = arm.read()?;
        controller.set(fault.clone());
        let mut last = state.time;
        for _ in 0..100 {
            state = step(&mut arm, &state).map_err(|e| format!("{fault:?}: {e}"))?;
            assert!(state.time > last && state.is_finite());
            last = state.time;
        }
        let stats = arm.stats();
        match fault {
            Fault::Repeat => assert!(stats.duplicates > 50, "{stats:?}"),
            Fault::Merge(_) => assert!(stats.skipped > 50, "{stats:?}"),
            Fault::Texts(_) => {
                let texts = arm.take_texts();
                assert_eq!(texts.len(), 32);
                assert_eq!(texts[0].1, "é".repeat(100));
                assert!(arm.take_texts().len() < 32);
            }
            _ => {}
        }
    }
    Ok(())
}

#[test]
fn garbage_closes_the_connection() -> Outcome {
    for (bytes, what) in [
        (vec![0, 0, b'U', 1], "fewer than its header"),
        (vec![0, 2, b'U', 1], "fewer than its header"),
        (vec![0, 4, b'U', 1], "holds 0 bytes of values"),
        (b"HTTP/1.1 400 Bad Request\r\n".to_vec(), "port 30004"),
        (vec![255; 40], "port 30004"),
        (vec![0, 6, b'U', 1, 2, 3], "holds 2 bytes of values"),
        (vec![0, 3, b'V'], "ends too early"),
        (vec![0, 4, b'V', 1], "while data was due"),
        (vec![0, 5, b'U', 9, 9], "data of recipe 9"),
    ] {
        let controller = Controller::start(1.0);
        let (mut arm, state) = moving(&controller)?;
        controller.set(Fault::Garbage(bytes));
        let error = until_error(&mut arm, state);
        assert_eq!(error.kind(), FaultKind::Protocol, "{error}");
        assert!(error.to_string().contains(what), "{error}");
        rests(&controller, &mut arm);
        goes_on(&controller, &mut arm)?;
    }
    Ok(())
}

/// A length that never comes: memory stays bounded and the deadline decides.
#[test]
fn a_packet_that_never_ends() -> Outcome {
    let controller = Controller::start(1.0);
    let (mut arm, state) = moving(&controller)?;
    controller.lock().fault = Fault::Garbage(vec![255, 255, b'U', 1]);
    let error = until_error(&mut arm, state);
    // The next packets are swallowed by it until its length is reached, which does not fit the recipe.
    assert!(matches!(error.kind(), FaultKind::Link | FaultKind::Protocol), "{error}");
    rests(&controller, &mut arm);
    Ok(())
}

#[test]
fn a_controller_that_restarts() -> Outcome {
    let controller = Controller::start(1.0);
    let (mut arm, state) = moving(&controller)?;
    controller.set(Fault::ClockBack);
    let error = until_error(&mut arm, state);
    assert!(matches!(error, UrError::ClockBack { .. }), "{error}");
    assert_eq!(error.kind(), FaultKind::Link);
    rests(&controller, &mut arm);
    goes_on(&controller, &mut arm)
}

#[test]
fn a_wrench_that_is_no_number() -> Outcome {
    let controller = Controller::start(1.0);
    let (mut arm, state) = moving(&controller)?;
    controller.lock().load[2] = f64::NAN;
    let error = until_error(&mut arm, state);
    assert_eq!(error.kind(), FaultKind::Sensor, "{error}");
    rests(&controller, &mut arm);
    controller.lock().load[2] = 0.0;
    goes_on(&controller, &mut arm)
}

#[test]
fn the_speed_slider() -> Outcome {
    let controller = Controller::start(1.0);
    let (mut arm, state) = moving(&controller)?;
    controller.lock().slider = 0.4;
    let error = until_error(&mut arm, state);
    assert!(error.to_string().contains("at 40 %"), "{error}");
    rests(&controller, &mut arm);
    controller.lock().slider = 1.0;
    goes_on(&controller, &mut arm)
}

#[test]
fn a_program_that_is_killed_is_loaded_again_by_recover_only() -> Outcome {
    let controller = Controller::start(1.0);
    let (mut arm, state) = moving(&controller)?;
    {
        let mut world = controller.lock();
        world.program = None;
        world.runtime = 1;
    }
    let error = until_error(&mut arm, state);
    assert!(matches!(error, UrError::Program(_)), "{error}");
    for _ in 0..20 {
        let _ = arm.read();
    }
    assert_eq!(controller.lock().uploads, 1);
    rests(&controller, &mut arm);
    goes_on(&controller, &mut arm)?;
    assert_eq!(controller.lock().uploads, 2);
    Ok(())
}

/// Stops of the safety system: `PALPATE_UR_STOPS` of them (20 here).
#[test]
fn a_stop_of_the_safety_system_waits_for_a_person() -> Outcome {
    let stops = std::env::var("PALPATE_UR_STOPS").ok().and_then(|n| n.parse().ok()).unwrap_or(20);
    let controller = Controller::start(4.0);
    let mut config = controller.config();
    config.stall_ticks = 100;
    let mut arm = UrArm::connect(config)?;
    let operator = arm.operator();
    for n in 0..stops {
        let mut state = arm.read()?;
        for _ in 0..n % 7 {
            state = step(&mut arm, &state)?;
        }
        let status = [3, 5, 6, 7, 8, 9, 2, 99][n % 8];
        controller.lock().safety = status;
        let error = until_error(&mut arm, state);
        assert!(matches!(error, UrError::Safety(s) if i32::from(s) == status), "{error}");
        let moved = controller.lock().moving_ticks;
        // Not while it lasts …
        assert_eq!(arm.recover().unwrap_err().kind(), FaultKind::RobotState);
        // … and not when it is over either, before a person has said so.
        controller.lock().safety = 1;
        let uploads = controller.lock().uploads;
        assert!(matches!(arm.recover(), Err(UrError::NeedsOperator(_) | UrError::Safety(_))));
        let q = arm.sample().q();
        assert_eq!(arm.write(&JointCommand { q }).unwrap_err().kind(), FaultKind::Stopped);
        let world = controller.lock();
        assert_eq!((world.moving_ticks, world.uploads), (moved, uploads));
        drop(world);
        operator.acknowledge();
        if let Err(error) = arm.recover() {
            // The last samples of the stop were still on their way.
            assert!(matches!(error, UrError::Safety(_)), "{error}");
            operator.acknowledge();
            arm.recover()?;
        }
    }
    Ok(())
}

/// A controller that takes no bytes: writes return at once and say that they were dropped.
#[test]
fn writes_never_wait() -> Outcome {
    use palpate_ur::proto::{Setup, Value};
    let controller = Controller::start(1.0);
    let mut client = palpate_ur::RtdeClient::connect(
        "127.0.0.1",
        controller.ports.rtde,
        Setup {
            frequency: 500.0,
            outputs: vec!["timestamp".into()],
            inputs: vec![vec!["input_double_register_24".into()]],
            timeout: Duration::from_secs(2),
        },
    )?;
    controller.set(Fault::Dead);
    std::thread::sleep(Duration::from_millis(20));
    let mut longest = Duration::ZERO;
    for _ in 0..3_000_000 {
        let begin = Instant::now();
        let taken = client.write(0, &[Value::Double(1.0)])?;
        longest = longest.max(begin.elapsed());
        if !taken {
            // The scheduler may take the processor away, a full socket may not.
            assert!(longest < Duration::from_secs(1), "{longest:?}");
            return Ok(());
        }
    }
    panic!("the network took everything");
}
