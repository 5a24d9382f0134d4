//! The interpreter: many small programs against what they must do.

use palpate_virtual_ur::script::testing::Recorder;
use palpate_virtual_ur::script::{Machine, Status, Value, compile};

/// Runs a program to its end and returns what `textmsg` said, one line each.
fn said(text: &str) -> Result<String, String> {
    let (machine, world) = run(text, Recorder::default(), 1000)?;
    drop(machine);
    Ok(world.messages.join("\n"))
}

fn run(text: &str, mut world: Recorder, ticks: u32) -> Result<(Machine, Recorder), String> {
    let mut machine = Machine::new(compile(text).map_err(|e| e.to_string())?);
    for _ in 0..ticks {
        if machine.tick(&mut world).map_err(|e| e.to_string())? == Status::Finished {
            return Ok((machine, world));
        }
    }
    Ok((machine, world))
}

/// The value of an expression, as `textmsg` prints it.
fn value(expression: &str) -> Result<String, String> {
    said(&format!("def f():\n textmsg(to_str({expression}))\nend\n"))
}

#[test]
fn expressions_have_their_values() {
    for (expression, expected) in [
        ("1 + 2 * 3", "7"),
        ("(1 + 2) * 3", "9"),
        ("2 - 3 - 4", "-5"),
        ("7 / 2", "3.5"),
        ("8 / 2", "4"),
        ("7 % 3", "1"),
        ("-7 % 3", "-1"),
        ("7.5 % 2", "1.5"),
        ("-2 * -3", "6"),
        ("1 + 0.5", "1.5"),
        ("1 < 2 and 2 < 3", "True"),
        ("1 < 2 and not 2 < 3", "False"),
        ("False or True xor True", "False"),
        ("not False and False", "False"),
        ("1 == 1.0", "True"),
        ("\"a\" == \"b\"", "False"),
        ("[1, 2] == [1, 2.0]", "True"),
        ("[1, 2] != [1]", "True"),
        ("True != False", "True"),
        ("[1, 2, 3][1]", "2"),
        ("[[1, 2], [3, 4]][1][0]", "3"),
        ("p[1, 2, 3, 0, 0, 0][2]", "3"),
        ("[1, 2] + [3, 4.5]", "[4, 6.5]"),
        ("[1, 2] - [3, 5]", "[-2, -3]"),
        ("2 * [1, 2]", "[2, 4]"),
        ("[1, 2] / 2", "[0.5, 1]"),
        ("-[1, -2]", "[-1, 2]"),
        ("0x1F", "31"),
        ("1e-3", "0.001"),
        ("floor(2.7) + ceil(2.1)", "5"),
        ("floor(-2.5)", "-3"),
        ("norm(-3)", "3"),
        ("norm([3, 4])", "5"),
        ("norm(p[2, 3, 6, 9, 9, 9])", "7"),
        ("sqrt(2) * sqrt(2)", "2"),
        ("pow(2, 10)", "1024"),
        ("log(2, 8)", "3"),
        ("atan2(1, -1)", "2.35619"),
        ("d2r(180)", "3.14159"),
        ("r2d(acos(0))", "90"),
        ("length([1, 2, 3])", "3"),
        ("length(make_list(4, 0))", "4"),
        ("normalize([0, 3, 4])", "[0, 0.6, 0.8]"),
        ("str_cat(\"a\", 1)", "a1"),
        ("str_len(\"abc\")", "3"),
        ("str_at(\"abc\", 1)", "b"),
        ("to_num(\"42\") + to_num(\"0.5\")", "42.5"),
        ("point_dist(p[1,2,3,0,0,0], p[1,5,7,0,0,0])", "5"),
        // A quarter turn about z carries x to y.
        ("pose_trans(p[0,0,0,0,0,d2r(90)], p[1,0,0,0,0,0])[1]", "1"),
        (
            "norm(pose_trans(p[1,2,3,0.1,0.2,0.3], pose_inv(p[1,2,3,0.1,0.2,0.3]))) < 0.0000001",
            "True",
        ),
        ("interpolate_pose(p[0,0,0,0,0,0], p[1,0,0,0,0,2], 0.25)[5]", "0.5"),
        ("pose_sub(p[3,0,0,0,0,1], p[1,0,0,0,0,0.25])", "p[2, 0, 0, 0, 0, 0.75]"),
    ] {
        assert_eq!(value(expression).as_deref(), Ok(expected), "{expression}");
    }
}

#[test]
fn wrong_expressions_name_line_and_reason() {
    for (expression, expected) in [
        ("2147483647 + 1", "integer overflow: integers have 32 bits"),
        ("1 / 0", "division by zero"),
        ("1 % 0", "division by zero"),
        ("1 + True", "cannot add an integer and a boolean"),
        ("\"a\" + \"b\"", "cannot add a string and a string"),
        ("[1] + [1, 2]", "cannot add a list and a list"),
        ("1 == \"1\"", "cannot compare an integer and a string"),
        ("1 and True", "cannot decide by an integer"),
        ("True and 1", "cannot decide by an integer"),
        ("not 1", "cannot apply not to an integer"),
        ("[1, 2][2]", "index 2 of a list with 2 elements"),
        ("[1, 2][-1]", "index -1 of a list with 2 elements"),
        ("[1, 2][0.0]", "cannot index with a float"),
        ("5[0]", "cannot index an integer"),
        ("nothing", "the variable nothing is used before it has a value"),
        ("nothing()", "nothing is no function: define it before, or check the spelling"),
        ("sqrt(-1)", "sqrt: -1 has no square root"),
        ("acos(2)", "acos: 2 is not in [-1, 1]"),
        ("sin()", "sin: f is missing"),
        ("sin(1, 2)", "sin: takes 1 arguments at most"),
        ("sin(g=1)", "sin: has no parameter g"),
        ("sin(1, f=1)", "sin: f is given twice"),
        ("p[1, 2]", "expected six elements, found 2 elements"),
        ("p[1, 2, 3, 4, 5, True]", "cannot make a pose of [1, 2, 3, 4, 5, True]"),
        ("floor(1e10)", "floor: 10000000000 fits no 32-bit integer"),
        ("force_mode(1)", "force_mode exists on a real controller but is not modelled here"),
        ("1 +", "expected an expression, found )"),
    ] {
        let expected = format!("line 2: {expected}");
        assert_eq!(value(expression), Err(expected), "{expression}");
    }
}

#[test]
fn control_flow() {
    let cases = [
        (
            "if, elif, else",
            "def f():
  n = 0
  while n < 4:
    if n == 0:
      textmsg(\"zero\")
    elif n == 1 or n == 2:
      textmsg(\"few\")
    else:
      textmsg(\"many\")
    end
    n = n + 1
  end
end",
            "zero\nfew\nfew\nmany",
        ),
        (
            "break and continue leave only the inner loop; indentation means nothing",
            "def f():
n = 0
  while True:
n = n + 1
      if n == 2:
continue
end
    if n > 4:
break
    end
m = 0
while True:
m = m + 1
if m == n:
break
end
end
textmsg(n, m)
end
end",
            "11\n33\n44",
        ),
        (
            "a function's last value, early return, recursion, default and named arguments",
            "def f():
  def factorial(n):
    if n <= 1: return 1 end
    return n * factorial(n - 1)
  end
  def scaled(x, by=10, plus=0):
    return x * by + plus
  end
  textmsg(factorial(10))
  textmsg(scaled(2), scaled(2, plus=1, by=3))
end",
            "3628800\n207",
        ),
        (
            "and/or do not evaluate what is decided",
            "def f():
  def loud(b):
    textmsg(\"seen\")
    return b
  end
  a = False and loud(True)
  b = True or loud(True)
  c = True and loud(False)
  textmsg([a, b, c])
end",
            "seen\n[False, True, False]",
        ),
        (
            "lists are copied, elements assigned at any depth",
            "def f():
  a = [[1, 2], [3, 4]]
  b = a
  b[1][0] = 9
  pose = p[0, 0, 0, 0, 0, 0]
  pose[2] = 0.5
  textmsg(a, b)
  textmsg(pose)
end",
            "[[1, 2], [3, 4]][[1, 2], [9, 4]]\np[0, 0, 0.5, 0, 0, 0]",
        ),
        (
            "a value on the next line, and a statement behind a value",
            "def f():\n a = # first\n7    global b = 2 c = 3\n textmsg([a, b, c])\nend",
            "[7, 2, 3]",
        ),
        (
            "a variable may be called p",
            "def f():\n def scaled(p):\n  p[0] = p[0] * 2\n  return p\n end\n textmsg(scaled(p[1, 2, 3, 0, 0, 0]))\nend",
            "p[2, 2, 3, 0, 0, 0]",
        ),
        ("statements without def, comments", "textmsg(\"one\") # and more\n", "one"),
        (
            "halt ends everything",
            "def f():\n def g():\n  halt\n end\n g()\n textmsg(\"never\")\nend",
            "",
        ),
    ];
    for (what, text, expected) in cases {
        assert_eq!(said(text).as_deref(), Ok(expected), "{what}");
    }
}

#[test]
fn names_are_global_local_or_free_as_the_manual_says() {
    // The four examples of the script manual's section on scope, with the values made visible.
    for (what, text, expected) in [
        (
            "local hides the global",
            "def f():\n global a = 0\n def g():\n  local a = 1\n  textmsg(a)\n end\n g()\n textmsg(a)\nend",
            "1\n0",
        ),
        (
            "a free name finds the global",
            "def f():\n global a = 0\n def g():\n  a = 1\n end\n g()\n textmsg(a)\nend",
            "1",
        ),
        (
            "the same one level deeper",
            "def f():\n global a = 0\n def g():\n  local a = 1\n  def h():\n   a = 2\n  end\n  h()\n  textmsg(a)\n end\n g()\n textmsg(a)\nend",
            "1\n2",
        ),
        (
            "the first level is global without the word",
            "def f():\n a = 0\n def g():\n  a = 1\n end\n g()\n textmsg(a)\nend",
            "1",
        ),
        (
            "a name of one function is not one of another",
            "def f():\n def g():\n  b = 1\n  return b\n end\n def h():\n  b = 2\n  g()\n  return b\n end\n textmsg(h())\nend",
            "2",
        ),
        (
            "global from inside a function",
            "def f():\n def g():\n  global made = 5\n end\n g()\n textmsg(made)\nend",
            "5",
        ),
    ] {
        assert_eq!(said(text).as_deref(), Ok(expected), "{what}");
    }
    let unset = "def f():\n def g():\n  if False:\n   b = 1\n  end\n  textmsg(b)\n end\n g()\nend";
    assert_eq!(said(unset), Err("line 6: the variable b is used before it has a value".into()));
    let nothing = "def f():\n def g():\n  pass\n end\n a = g()\nend";
    assert!(
        said(nothing).unwrap_err().starts_with("line 5: cannot store the result of a function")
    );
}

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

#[test]
fn what_is_no_program_is_refused_with_its_line() {
    for (text, expected) in [
        ("def f():\n if True:\nend", "line 3: expected end, found the end of the program"),
        ("def f():\n x = \nend", "line 3: expected an expression, found end"),
        ("def f():\n x + 1\nend", "line 2: expected an assignment or a call"),
        ("def f():\n 1 + 1\nend", "line 2: expected a statement, found 1"),
        ("def f():\n end = 1\nend", "line 2: expected"),
        ("def f():\n break\nend", "line 2: break outside a while loop"),
        ("def f():\n def sync():\n end\nend", "line 2: sync is already the name of a function"),
        ("def f():\n def g():\n end\n def g():\n end\nend", "line 4: g is already"),
        ("def f():\n thread t(a):\n end\nend", "line 2: t is a thread, which takes no parameters"),
        ("def f():\n def g():\n end\n run g()\nend", "line 4: g is no thread"),
        ("def f():\n thread t():\n end\n t()\nend", "line 4: t is no function that can be called"),
        ("def f():\n f()\nend", "line 2: f is no function that can be called"),
        ("thread t():\nend", "line 1: expected def program():"),
        ("def f(a):\nend", "line 1: expected def program():"),
        ("def f():\n movej(q=[0], a=1, q=[0])\nend", "line 2: movej: q is given twice"),
        ("def f():\n a = 1 2\nend", "line 2: expected the end of the line, found 2"),
        ("def f():\n a = 1 b\nend", "line 2: expected an assignment or a call"),
        ("def f():\n a = \"open\nend", "line 2: the string is not closed on its line"),
    ] {
        let error = compile(text).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{text}\n→ {error}");
    }
}

#[test]
fn registers_are_read_and_written() {
    let text = "def f():
  a = read_input_integer_register(24) + 1
  write_output_integer_register(25, a)
  write_output_float_register(address=26, value=a / 2)
end";
    let world = Recorder { inputs: [(24, Value::Int(6))].into(), ..Recorder::default() };
    let (_, world) = run(text, world, 2).unwrap();
    assert_eq!(world.outputs, [(25, Value::Int(7)), (26, Value::Float(3.5))].into());
    let error = said(text).unwrap_err();
    assert_eq!(error, "line 2: read_input_integer_register: input register 24 was not set");
}

#[test]
fn a_secondary_program_neither_moves_nor_waits() {
    assert_eq!(said("sec s():\n textmsg(\"hi\")\nend").as_deref(), Ok("hi"));
    for (call, reason) in
        [("movej([0,0,0,0,0,0])", "cannot move the arm"), ("sync()", "cannot take time")]
    {
        let error = said(&format!("sec s():\n {call}\nend")).unwrap_err();
        assert!(error.starts_with("line 2") && error.contains(reason), "{error}");
    }
}

#[test]
fn deep_nesting_and_long_chains_end_in_an_error_and_not_in_a_full_stack() {
    for text in [
        "(".repeat(100_000),
        format!("x = {}1", "-".repeat(100_000)),
        format!("x = {}True", "not ".repeat(100_000)),
        format!("x = 1{}", "+1".repeat(100_000)),
        format!("x = {}", "[".repeat(100_000)),
        "if True:\n".repeat(100_000),
        "def f():\n".repeat(100_000),
        format!("x = a{}", "[0]".repeat(100_000)),
    ] {
        compile(&text).unwrap_err();
    }
}

mod any_text {
    use super::{Machine, Recorder, compile};
    use proptest::prelude::*;

    /// Words of the language in any order: most of it is no program, all of it must be handled.
    fn soup() -> impl Strategy<Value = String> {
        let word = prop::sample::select(vec![
            "def f():",
            "thread t():",
            "end",
            "\n",
            "while True:",
            "if x:",
            "else:",
            "x",
            " = ",
            "1",
            "2.5",
            "+",
            "-",
            "(",
            ")",
            "[",
            "]",
            "p[",
            ",",
            "sync()",
            "run t()",
            "kill x",
            "return",
            "break",
            "\"s\"",
            "not ",
            " and ",
            "global x",
            "local y",
            "servoj(x)",
            "length(x)",
            "x[0]",
            "halt",
            "#",
            ":",
        ]);
        prop::collection::vec(word, 0..60).prop_map(|words| words.concat())
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn gives_a_program_or_an_error(text in soup()) {
            if let Ok(program) = compile(&text) {
                let mut machine = Machine::new(program);
                for _ in 0..5 {
                    if machine.tick(&mut Recorder::default()).is_err() {
                        break;
                    }
                }
            }
        }

        #[test]
        fn so_do_arbitrary_bytes(text in ".{0,200}") {
            _ = compile(&text);
        }
    }
}
