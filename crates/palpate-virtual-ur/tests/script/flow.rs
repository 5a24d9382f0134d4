//! Statements, functions, names.

use palpate_virtual_ur::script::Value;
use palpate_virtual_ur::script::testing::Recorder;

use crate::common::{run, said};

#[test]
#[expect(clippy::too_many_lines, reason = "a table of programs")]
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
