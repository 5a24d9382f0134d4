//! What the user gets when the network or the controller fails: one test per fault.
//!
//! Everywhere: the fault is named in the tick in which it shows, commands are refused from then on, the
//! commanded joints do not jump, and nothing moves again unless asked to.

mod support;

use std::time::{Duration, Instant};

use palpate_robot_io::{BackendError, FaultKind, RobotBackend};
use palpate_ur::{UrArm, UrError};
use support::moves::{Outcome, goes_on, moving, rests, step, until_error};
use support::{Controller, Fault};

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
fn a_controller_of_protocol_version_1() {
    let controller = Controller::start(1.0);
    controller.lock().only_version_1 = true;
    let error = UrArm::connect(controller.config()).unwrap_err();
    assert_eq!(error.kind(), FaultKind::Protocol);
    assert!(error.to_string().contains("version 2, it speaks version 1"), "{error}");
}

#[test]
fn registers_in_use_are_waited_for_then_named() -> Outcome {
    let controller = Controller::start(1.0);
    controller.lock().in_use = 2;
    drop(UrArm::connect(controller.config())?);
    controller.lock().in_use = u32::MAX;
    let mut config = controller.config();
    config.attempts = 2;
    let error = UrArm::connect(config).unwrap_err().to_string();
    for part in ["input_int_register_24", "input_double_register_30", "URCap"] {
        assert!(error.contains(part), "{error}");
    }
    Ok(())
}

#[test]
fn missing_variables_are_all_named() {
    let controller = Controller::start(1.0);
    controller.lock().missing = vec!["safety_status".into(), "payload".into()];
    let error = UrArm::connect(controller.config()).unwrap_err().to_string();
    assert!(error.contains("payload") && error.contains("safety_status"), "{error}");
}

#[test]
fn nobody_there() {
    let mut config = palpate_ur::UrConfig::at("127.0.0.1");
    config.ports.rtde = 1;
    config.attempts = 2;
    let error = UrArm::connect(config).unwrap_err();
    assert_eq!(error.kind(), FaultKind::Link);
    assert!(error.to_string().contains("127.0.0.1:1"), "{error}");
}

/// Stops of the safety system: `PALPATE_UR_STOPS` of them (20 here).
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
