//! What is no program.

use palpate_virtual_ur::script::compile;

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
