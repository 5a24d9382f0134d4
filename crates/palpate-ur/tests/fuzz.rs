//! Mutated packets at full speed: whatever arrives gives a packet, a wait or a typed error.
//!
//! `PALPATE_FUZZ_PACKETS` says how many per test (10,000,000 in all four by default); the seed is fixed, so
//! that a failure repeats.
#![expect(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]
#![expect(clippy::print_stdout, reason = "`--nocapture` shows what the mutations reached")]

use std::time::Duration;

use palpate_ur::proto::*;
use rand::{Rng, RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn share() -> usize {
    let all = std::env::var("PALPATE_FUZZ_PACKETS").ok().and_then(|n| n.parse().ok());
    all.unwrap_or(10_000_000) / 4
}

const NAMES: [&str; 4] = ["timestamp", "actual_q", "runtime_state", "output_int_register_24"];
const TYPES: [DataType; 4] =
    [DataType::Double, DataType::Vector6d, DataType::Uint32, DataType::Int32];

fn text() -> Text<'static> {
    Text { message: "C153A0 joint".into(), source: "RTDE".into(), level: Level::Warning }
}

/// Whole packets of a server, in the order of a connection.
fn server_packets() -> Vec<Vec<u8>> {
    let types = TYPES.map(VariableReply::Type).to_vec();
    let version = ControllerVersion { major: 5, minor: 17, bugfix: 1, build: 2 };
    let packets = [
        ServerPacket::VersionAccepted(true),
        ServerPacket::ControllerVersion(version),
        ServerPacket::OutputRecipe { recipe: 1, types: types.clone() },
        ServerPacket::InputRecipe { recipe: 1, types: vec![types[3]; 3] },
        ServerPacket::Started(true),
        ServerPacket::Data { recipe: 1, values: &[0x40; 64] },
        ServerPacket::Text(text()),
        ServerPacket::Data { recipe: 1, values: &[0xff; 64] },
        ServerPacket::Paused(true),
        ServerPacket::InputRecipe { recipe: 0, types: vec![VariableReply::InUse; 9] },
    ];
    packets.iter().map(|p| encoded(|out| p.encode(Version::V2, out))).collect()
}

fn client_packets() -> Vec<Vec<u8>> {
    let names: Vec<_> = NAMES.iter().map(|n| (*n).into()).collect();
    let packets = [
        ClientPacket::RequestVersion(2),
        ClientPacket::ControllerVersion,
        ClientPacket::SetupOutputs { frequency: 500.0, names: names.clone() },
        ClientPacket::SetupInputs { names },
        ClientPacket::Start,
        ClientPacket::Data { recipe: 1, values: &[0x40; 68] },
        ClientPacket::Text(text()),
        ClientPacket::Pause,
    ];
    packets.iter().map(|p| encoded(|out| p.encode(Version::V2, out))).collect()
}

fn encoded(write: impl FnOnce(&mut Vec<u8>) -> Result<(), EncodeError>) -> Vec<u8> {
    let mut out = Vec::new();
    write(&mut out).unwrap();
    out
}

/// A packet with something wrong with it, mostly.
fn mutate(rng: &mut ChaCha8Rng, corpus: &[Vec<u8>], packet: &mut Vec<u8>) {
    packet.clear();
    packet.extend_from_slice(&corpus[rng.random_range(0..corpus.len())]);
    let at = rng.random_range(0..packet.len());
    match rng.random_range(0..9) {
        0 => packet[at] ^= 1 << rng.random_range(0..8),
        1 => packet[at] = rng.random(),
        2 => packet.truncate(at),
        3 => packet.insert(at, rng.random()),
        4 => packet[..2].copy_from_slice(&rng.random::<u16>().to_be_bytes()),
        // Small lies about the size are the ones that keep the stream going.
        5 => packet[1] = packet[1].wrapping_add(rng.random_range(0..7)).wrapping_sub(3),
        6 => {
            let n = packet.len();
            rng.fill_bytes(&mut packet[3.min(n)..]);
        }
        7 => {
            let other = &corpus[rng.random_range(0..corpus.len())];
            packet.truncate(at);
            packet.extend_from_slice(&other[rng.random_range(0..other.len())..]);
        }
        _ => {}
    }
    // A size that is a lie makes the next packets part of this one: mostly, let the size be true, so that
    // what is wrong with the rest is looked at.
    if packet.len() >= HEADER && rng.random_bool(0.97) {
        let size = packet.len() as u16;
        packet[..2].copy_from_slice(&size.to_be_bytes());
    }
}

/// Feeds bytes in pieces of any size.
fn feed(
    rng: &mut ChaCha8Rng,
    framer: &mut Framer,
    bytes: &[u8],
    mut each: impl FnMut(Frame<'_>),
) -> bool {
    let mut left = bytes;
    while !left.is_empty() {
        let piece =
            if rng.random_bool(0.8) { left.len() } else { rng.random_range(1..=left.len()) };
        let taken = framer.push(&left[..piece]);
        assert!(taken > 0, "no room although every frame was taken");
        left = &left[taken..];
        loop {
            match framer.next_frame() {
                Ok(Some(frame)) => each(frame),
                Ok(None) => break,
                Err(_) => return false,
            }
        }
        assert!(framer.pending() < MAX_PACKET);
    }
    true
}

fn decode_everything(seed: u64, corpus: &[Vec<u8>], mut decode: impl FnMut(Frame<'_>) -> bool) {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let (mut framer, mut packet) = (Framer::new(), Vec::new());
    let (mut frames, mut good, mut broken) = (0_u64, 0_u64, 0_u64);
    for _ in 0..share() {
        mutate(rng, corpus, &mut packet);
        let fine = feed(rng, &mut framer, &packet, |frame| {
            frames += 1;
            good += u64::from(decode(frame));
        });
        broken += u64::from(!fine);
        // Do not wait for the end of a packet that swallows everything, most of the time.
        if !fine || framer.pending() > 1000 && rng.random_bool(0.5) {
            framer.clear();
        }
    }
    println!(
        "{} packets, {frames} frames, {good} of them decoded, {broken} streams broken",
        share()
    );
    // The mutations reach all three outcomes, or this tests nothing.
    assert!(frames > share() as u64 / 3 && good > frames / 4 && frames > good && broken > 0);
}

#[test]
fn what_a_server_may_send() {
    decode_everything(1, &server_packets(), |frame| {
        let v1 = ServerPacket::decode(Version::V1, frame).is_ok();
        let v2 = ServerPacket::decode(Version::V2, frame);
        if let Ok(ServerPacket::Data { values, .. }) = v2 {
            let recipe = Recipe::new(1, NAMES.iter().copied().zip(TYPES));
            assert_eq!(recipe.values(values).is_ok(), values.len() == 64);
        }
        v1 | v2.is_ok()
    });
}

#[test]
fn what_a_client_may_send() {
    decode_everything(2, &client_packets(), |frame| {
        ClientPacket::decode(Version::V1, frame).is_ok()
            | ClientPacket::decode(Version::V2, frame).is_ok()
    });
}

fn session() -> Session {
    let setup = Setup {
        frequency: 500.0,
        outputs: NAMES.map(Into::into).to_vec(),
        inputs: vec![vec!["input_int_register_24".into(); 3]],
        timeout: Duration::from_secs(1),
    };
    Session::new(setup, Duration::ZERO).unwrap()
}

/// Puts bytes into a session; `false` once it has failed.
fn converse(session: &mut Session, mut bytes: &[u8]) -> bool {
    while !bytes.is_empty() {
        let space = session.space();
        let n = space.len().min(bytes.len());
        space[..n].copy_from_slice(&bytes[..n]);
        session.filled(n);
        bytes = &bytes[n..];
        loop {
            match session.next_event(Duration::ZERO) {
                Ok(None) => break,
                Err(_) => {
                    assert_eq!(
                        session.next_event(Duration::ZERO).unwrap_err(),
                        SessionError::Failed
                    );
                    return false;
                }
                Ok(Some(Event::Data(record))) => {
                    for (n, want) in TYPES.into_iter().enumerate() {
                        assert_eq!(record.value(n).data_type(), want);
                    }
                }
                Ok(Some(_)) => {}
            }
        }
        let sent = session.outgoing().len();
        assert!(sent < 4096, "the outgoing queue grows");
        session.sent(sent);
    }
    true
}

/// A connection that goes well until one packet, or most packets, are not what they should be.
fn sessions(seed: u64, mutated: f64) {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let corpus = server_packets();
    let mut packet = Vec::new();
    let (mut connection, mut at, mut failed, mut ran) = (session(), 0, 0_u64, 0_u64);
    for _ in 0..share() {
        if rng.random_bool(mutated) {
            mutate(rng, &corpus, &mut packet);
        } else {
            // The setup in order, then data for ever.
            packet.clone_from(&corpus[at.min(5)]);
        }
        at += 1;
        let fine = converse(&mut connection, &packet);
        ran += u64::from(connection.is_running());
        if !fine {
            failed += 1;
            (connection, at) = (session(), 0);
        }
    }
    println!("{} packets, {failed} connections failed, {ran} packets left one running", share());
    assert!(failed > 0 && ran > 0);
}

#[test]
fn a_session_that_is_disturbed_now_and_then() {
    sessions(3, 0.05);
}

#[test]
fn a_session_that_is_mostly_garbage() {
    sessions(4, 0.5);
}
