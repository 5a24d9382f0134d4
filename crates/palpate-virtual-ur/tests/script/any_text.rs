//! Any text is a program or an error.

use palpate_virtual_ur::script::testing::Recorder;
use palpate_virtual_ur::script::{Machine, compile};
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
