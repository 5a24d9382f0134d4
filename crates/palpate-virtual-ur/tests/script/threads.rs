//! Time, threads and the bound on work.

use palpate_virtual_ur::script::testing::Recorder;
use palpate_virtual_ur::script::{Machine, Status, compile};

use crate::common::{run, said};

#[test]
fn sync_takes_exactly_one_tick_and_threads_interleave_in_order_of_creation() {
    let text = "def f():
  n = 0
  thread ping():
    while True:
      textmsg(\"ping\", n)
      sync()
    end
  end
  h = run ping()
  while n < 3:
    n = n + 1
    textmsg(\"main\", n)
    sync()
  end
  kill h
  sync()
  textmsg(\"end\")
end";
    assert_eq!(said(text).unwrap(), "main1\nping1\nmain2\nping2\nmain3\nping3\nend");
}

#[test]
fn sleep_join_and_motion_take_their_time() {
    let text = "def f():
  thread work():
    sleep(0.01)
    done = True
  end
  done = False
  h = run work()
  join h
  textmsg(done)
  movej([0, 0, 0, 0, 0, 0], a=1.4, v=1)
  textmsg(\"there\")
end";
    let mut machine = Machine::new(compile(text).unwrap());
    let mut world = Recorder::default();
    let mut log = Vec::new();
    for tick in 1..=30 {
        if tick == 20 {
            world.moving = false;
        }
        let before = world.messages.len();
        let status = machine.tick(&mut world).unwrap();
        log.extend(world.messages[before..].iter().map(|m| (tick, m.clone())));
        if status == Status::Finished {
            break;
        }
    }
    // 10 ms are five ticks: the thread goes on in tick 6, who waits for it in tick 7.
    assert_eq!(log, [(7, "True".to_owned()), (20, "there".to_owned())]);
    assert_eq!(world.calls.iter().filter(|c| c.starts_with("movej")).count(), 1);
    assert_eq!(world.calls[2], "movej([0, 0, 0, 0, 0, 0], 1.4, 1)");
}

#[test]
fn a_handle_of_zero_is_nobody() {
    let text = "def f():\n h = 0\n kill h\n join h\n kill 99\n textmsg(\"still here\")\nend";
    assert_eq!(said(text).as_deref(), Ok("still here"));
}

#[test]
fn only_one_thread_moves_the_arm_in_a_tick() {
    let text = "def f():
  thread other():
    while True:
      servoj([0, 0, 0, 0, 0, 0], t=0.002)
    end
  end
  run other()
  while True:
    servoj([0, 0, 0, 0, 0, 0])
  end
end";
    let error = said(text).unwrap_err();
    assert!(
        error.starts_with("line 4: another thread is already controlling the robot"),
        "{error}"
    );
    // One after the other is fine, and whoever is killed leaves its motion.
    let text = "def f():
  thread other():
    speedj([1, 0, 0, 0, 0, 0], 1)
    while True: sync() end
  end
  h = run other()
  sync()
  sync()
  kill h
  stopj(4)
end";
    let (_, world) = run(text, Recorder::default(), 20).unwrap();
    assert_eq!(world.abandoned, 1);
    assert!(world.calls.contains(&"stopj(4)".to_owned()), "{:?}", world.calls);
}

#[test]
fn a_critical_section_holds_the_other_threads() {
    let text = "def f():
  thread noisy():
    while True:
      textmsg(\"noise\")
      sync()
    end
  end
  run noisy()
  sync()
  enter_critical
  sync()
  sync()
  textmsg(\"quiet\")
  exit_critical
  sync()
end";
    assert_eq!(said(text).unwrap(), "noise\nquiet\nnoise");
}

#[test]
fn what_never_ends_is_reported_within_the_tick() {
    for (text, expected) in [
        ("def f():\n while True:\n end\nend", "line 2: infinite loop detected"),
        (
            "def f():\n thread t():\n  while True:\n   a = 1\n  end\n end\n run t()\n sync()\nend",
            "line 3: infinite loop detected",
        ),
        (
            "def f():\n def g():\n  return g()\n end\n g()\nend",
            "line 3: calls nested deeper than 200",
        ),
        (
            "def f():\n thread t():\n  sync()\n end\n while True:\n  run t()\n end\nend",
            "line 6: more than 50 threads",
        ),
        ("def f():\n while True:\n  sleep(0)\n end\nend", "line 2: infinite loop detected"),
    ] {
        let error = said(text).unwrap_err();
        assert!(error.starts_with(expected), "{text}: {error}");
    }
}
