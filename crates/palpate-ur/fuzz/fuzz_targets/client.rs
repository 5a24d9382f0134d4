//! Bytes of a server to the client: the same events whole or in pieces of seven bytes, or a typed error.
#![no_main]

use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use palpate_ur::Sample;
use palpate_ur::proto::{Session, Setup};

fn events(bytes: &[u8], piece: usize) -> Vec<String> {
    let setup = Setup {
        frequency: 500.0,
        outputs: Sample::outputs(),
        inputs: vec![vec!["input_int_register_24".into()]],
        timeout: Duration::from_secs(1),
    };
    let Ok(mut session) = Session::new(setup, Duration::ZERO) else { return Vec::new() };
    let mut seen = Vec::new();
    for mut part in bytes.chunks(piece) {
        while !part.is_empty() {
            let space = session.space();
            let n = space.len().min(part.len());
            space[..n].copy_from_slice(&part[..n]);
            session.filled(n);
            part = &part[n..];
            loop {
                match session.next_event(Duration::ZERO) {
                    Ok(Some(event)) => seen.push(format!("{event:?}")),
                    Ok(None) => break,
                    Err(error) => {
                        seen.push(error.to_string());
                        return seen;
                    }
                }
            }
            session.sent(session.outgoing().len());
        }
    }
    seen
}

fuzz_target!(|bytes: &[u8]| {
    // A framing error is seen as soon as the header is there, so the pieces may say it no later.
    assert_eq!(events(bytes, usize::MAX), events(bytes, 7));
});
