//! `soak packets`: damaged packets at full speed, through the client's and the server's protocol core.

use std::io::Write as _;
use std::time::{Duration, Instant};

use anyhow::{Context as _, ensure};
use palpate_kinematics::UrModel;
use palpate_ur::Sample;
use palpate_ur::proto::{DataType, Session, SessionError, Setup, Value};
use palpate_virtual_ur::rtde::ServerSession;
use palpate_virtual_ur::{Controller, ControllerConfig, LaggedArm};
use rand::{Rng, RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::interrupt;

/// How many, and which.
#[derive(Clone, Copy, Debug)]
pub struct Packets {
    /// To each side.
    pub count: u64,
    /// Of the damage.
    pub seed: u64,
}

/// Packets of one side, in order.
type Said = Vec<Vec<u8>>;

/// Longest answer to one packet and longest queue towards the network, bytes.
const BOUND: usize = 70_000;
/// No packet may take longer: far beyond a scheduler's whim.
const HANG: Duration = Duration::from_secs(2);

/// What a side made of what it got.
#[derive(Debug, Default)]
struct Outcome {
    /// Packets after which the connection was still up.
    survived: u64,
    /// Connections ended by an error.
    refused: u64,
    longest: Duration,
    took: Duration,
}

/// Damages the packets of a real conversation and gives them to the client and to the server.
///
/// # Errors
/// A queue grows or a packet takes too long. A panic ends the program.
pub fn packets(what: &Packets) -> anyhow::Result<()> {
    let (to_server, to_client) = conversation()?;
    let mut out = std::io::stdout();
    for (name, outcome) in
        [("client", client(what, &to_client)?), ("server", server(what, &to_server)?)]
    {
        let total = outcome.survived + outcome.refused;
        writeln!(
            out,
            "{name}: {total} packets in {:.1} s ({:.2} million/s), {} connections ended by a typed error, {} packets survived; the longest took {:.2} ms",
            outcome.took.as_secs_f64(),
            total as f64 / outcome.took.as_secs_f64() / 1e6,
            outcome.refused,
            outcome.survived,
            outcome.longest.as_secs_f64() * 1e3
        )?;
        ensure!(
            outcome.refused > 0 && outcome.survived > 0,
            "the {name} refused all or nothing: this tests nothing"
        );
        ensure!(outcome.longest < HANG, "a packet held the {name} up for {:?}", outcome.longest);
    }
    Ok(())
}

fn session() -> anyhow::Result<Session> {
    let names = |kind: &str, n: std::ops::Range<u8>| -> Vec<String> {
        n.map(|n| format!("input_{kind}_register_{n}")).collect()
    };
    Ok(Session::new(
        Setup {
            frequency: 500.0,
            outputs: Sample::outputs(),
            inputs: vec![[names("int", 24..27), names("double", 24..31)].concat()],
            timeout: Duration::from_secs(1),
        },
        Duration::ZERO,
    )?)
}

fn controller() -> anyhow::Result<Controller> {
    let home = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0].into();
    Ok(Controller::new(ControllerConfig::new(UrModel::Ur3e), Box::new(LaggedArm::at(home)))?)
}

/// What the two sides say to each other from the first byte on: to the server, to the client.
fn conversation() -> anyhow::Result<(Said, Said)> {
    let (mut session, mut robot) = (session()?, controller()?);
    let mut server = ServerSession::new(1);
    let (mut to_server, mut to_client) = (Vec::new(), Vec::new());
    for round in 0..30 {
        let asked = session.outgoing().to_vec();
        session.sent(asked.len());
        let mut answer = Vec::new();
        server.receive(&asked, &mut robot, &mut answer).context("the server's own client")?;
        if answer.is_empty() {
            robot.tick();
            server.data(&robot, &mut answer);
        }
        feed(&mut session, &answer)?;
        to_server.push(asked);
        to_client.push(answer);
        if session.is_running() {
            let mut values = [Value::Double(f64::from(round)); 10];
            values[..3].fill(Value::Int32(round));
            session.write(0, &values)?;
        }
    }
    ensure!(session.is_running(), "the two sides do not understand each other");
    for packets in [&mut to_server, &mut to_client] {
        packets.retain(|packet| !packet.is_empty());
    }
    Ok((to_server, to_client))
}

/// Everything that the client makes of these bytes.
fn feed(session: &mut Session, mut bytes: &[u8]) -> Result<(), SessionError> {
    while !bytes.is_empty() {
        let space = session.space();
        let n = space.len().min(bytes.len());
        space[..n].copy_from_slice(&bytes[..n]);
        session.filled(n);
        bytes = &bytes[n..];
        while let Some(event) = session.next_event(Duration::ZERO)? {
            if let palpate_ur::proto::Event::Data(record) = event {
                // Every value is looked at: what is read beyond the packet would show.
                debug_assert!(record.value(0).data_type() == DataType::Double);
                std::hint::black_box(Sample::read(&record));
            }
        }
    }
    Ok(())
}

/// The next packet of a conversation, mostly damaged.
fn damage(rng: &mut ChaCha8Rng, said: &[Vec<u8>], next: usize, packet: &mut Vec<u8>) {
    packet.clone_from(&said[next.min(said.len() - 1)]);
    // A conversation that never gets anywhere reaches little.
    if rng.random_bool(0.6) {
        return;
    }
    let at = rng.random_range(0..packet.len());
    match rng.random_range(0..8) {
        0 => packet[at] ^= 1 << rng.random_range(0..8),
        1 => packet[at] = rng.random(),
        2 => packet.truncate(at),
        3 => packet.insert(at, rng.random()),
        4 => packet[..2].copy_from_slice(&rng.random::<u16>().to_be_bytes()),
        5 => packet[1] = packet[1].wrapping_add(rng.random_range(0..7)).wrapping_sub(3),
        6 => rng.fill_bytes(&mut packet[at..]),
        _ => {
            let other = &said[rng.random_range(0..said.len())];
            packet.truncate(at);
            packet.extend_from_slice(&other[rng.random_range(0..other.len())..]);
        }
    }
    // With a true size what is wrong with the rest is looked at.
    if packet.len() >= 3 && rng.random_bool(0.8) {
        let size = packet.len() as u16;
        packet[..2].copy_from_slice(&size.to_be_bytes());
    }
}

/// Gives one side damaged packets; `take` says whether the connection is still up, `renew` makes the next.
fn drive<S>(
    what: &Packets,
    said: &[Vec<u8>],
    mut renew: impl FnMut(Option<S>) -> anyhow::Result<S>,
    mut take: impl FnMut(&mut S, &[u8]) -> anyhow::Result<bool>,
) -> anyhow::Result<Outcome> {
    let mut rng = ChaCha8Rng::seed_from_u64(what.seed);
    let (mut side, mut next, mut packet) = (renew(None)?, 0, Vec::new());
    let mut outcome = Outcome::default();
    let begin = Instant::now();
    for number in 0..what.count {
        if number % 65_536 == 0 && interrupt::requested() {
            break;
        }
        damage(&mut rng, said, next, &mut packet);
        next += 1;
        let before = Instant::now();
        let up = take(&mut side, &packet)?;
        outcome.longest = outcome.longest.max(before.elapsed());
        // A size that is a lie swallows packets for as long as it lasts: start again now and then.
        if up && next < 200 {
            outcome.survived += 1;
            continue;
        }
        if up {
            outcome.survived += 1;
        } else {
            outcome.refused += 1;
        }
        (side, next) = (renew(Some(side))?, 0);
    }
    outcome.took = begin.elapsed();
    Ok(outcome)
}

fn client(what: &Packets, said: &[Vec<u8>]) -> anyhow::Result<Outcome> {
    drive(
        what,
        said,
        |_| session(),
        |session, packet| {
            let up = feed(session, packet).is_ok();
            let queued = session.outgoing().len();
            ensure!(queued < BOUND, "{queued} bytes wait to be sent");
            session.sent(queued);
            Ok(up)
        },
    )
}

fn server(what: &Packets, said: &[Vec<u8>]) -> anyhow::Result<Outcome> {
    let (mut robot, mut out, mut number) = (controller()?, Vec::new(), 0);
    let robot = std::cell::RefCell::new(&mut robot);
    drive(
        what,
        said,
        |old: Option<ServerSession>| {
            if let Some(mut old) = old {
                old.close(*robot.borrow_mut());
            }
            number += 1;
            Ok(ServerSession::new(number))
        },
        |session, packet| {
            out.clear();
            let up = session.receive(packet, *robot.borrow_mut(), &mut out).is_ok();
            session.data(*robot.borrow_mut(), &mut out);
            ensure!(out.len() < BOUND, "{} bytes of answer to {}", out.len(), packet.len());
            Ok(up)
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_sides_survive_and_refuse() {
        packets(&Packets { count: 20_000, seed: 1 }).unwrap();
    }

    #[test]
    fn the_conversation_reaches_data() {
        let (to_server, to_client) = conversation().unwrap();
        assert!(to_server.iter().any(|p| p[2] == b'U') && to_client.iter().any(|p| p[2] == b'U'));
    }
}
