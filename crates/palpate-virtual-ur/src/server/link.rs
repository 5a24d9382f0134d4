//! One TCP connection to the controller.

use std::collections::VecDeque;
use std::io::{self, Read};
use std::net::TcpStream;

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::queue::Queue;
use crate::controller::{Controller, Severity, dashboard, ticks};
use crate::fault::Port;
use crate::rtde::ServerSession;
use crate::script::{Unit, Units};

/// What ails all connections to a port now: last cycles of faults that last.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Impairment {
    pub(super) mute_until: u64,
    pub(super) deaf_until: u64,
    pub(super) slow: (usize, u64),
    pub(super) split_until: u64,
    pub(super) merge: (u64, u64),
    /// Mean and jitter, s.
    pub(super) latency: Option<(f64, f64)>,
}

impl Impairment {
    pub(super) fn is_deaf(&self, now: u64) -> bool {
        now < self.deaf_until
    }

    fn delay(&self, rng: &mut ChaCha8Rng) -> u64 {
        let Some((mean, jitter)) = self.latency else { return 0 };
        ticks((mean + jitter * rng.random_range(-1.0..=1.0)).max(0.0))
    }
}

#[derive(Debug)]
enum Service {
    Rtde(Box<ServerSession>),
    Dashboard(Vec<u8>),
    Script(Units),
}

/// One connection.
#[derive(Debug)]
pub(super) struct Link {
    pub(super) port: Port,
    pub(super) closed: bool,
    stream: TcpStream,
    service: Service,
    incoming: VecDeque<(u64, Vec<u8>)>,
    outgoing: Queue,
    /// The last cycle in which the client took something, or had nothing to take.
    moved: u64,
    /// The client has closed its side.
    ended: bool,
    answer: Vec<u8>,
}

/// A dashboard line is shorter than this, bytes.
const LINE_MAX: usize = 4096;
/// A client that takes nothing for this long is dropped, s.
const UNREAD_MAX: f64 = 10.0;

impl Link {
    /// Connections at a time.
    pub(super) const COUNT_MAX: usize = 100;

    pub(super) fn new(port: Port, stream: TcpStream, client: u64, now: u64) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        let mut outgoing = Queue::default();
        let service = match port {
            Port::Rtde => Service::Rtde(Box::new(ServerSession::new(client))),
            Port::Dashboard => {
                outgoing.push(now, format!("{}\n", dashboard::GREETING).as_bytes());
                Service::Dashboard(Vec::new())
            }
            Port::Primary | Port::Secondary | Port::RealTime => Service::Script(Units::default()),
        };
        Ok(Self {
            port,
            closed: false,
            stream,
            service,
            incoming: VecDeque::new(),
            outgoing,
            moved: now,
            ended: false,
            answer: Vec::new(),
        })
    }

    pub(super) fn speak_version_1(&mut self) {
        if let Service::Rtde(session) = &mut self.service {
            session.speak_version_1();
        }
    }

    /// Bytes of a fault, between the packets.
    pub(super) fn intrude(&mut self, now: u64, bytes: &[u8]) {
        self.outgoing.push(now, bytes);
    }

    /// A text message, on RTDE.
    pub(super) fn text(&mut self, now: u64, text: &str) {
        if let Service::Rtde(session) = &self.service {
            let mut bytes = Vec::new();
            session.text(text, &mut bytes);
            self.outgoing.push(now, &bytes);
        }
    }

    /// Ends the connection at once: with RST, or in order.
    pub(super) fn cut(&mut self, reset: bool) {
        if reset {
            // Linger of zero: what is not sent yet is thrown away, and the other side told so. Without it
            // the close is an orderly one, which is a fault too.
            _ = rustix::net::sockopt::set_socket_linger(
                &self.stream,
                Some(std::time::Duration::ZERO),
            );
        }
        self.closed = true;
    }

    pub(super) fn end(&mut self, controller: &mut Controller) {
        if let Service::Rtde(session) = &mut self.service {
            session.close(controller);
        }
    }

    /// Reads what has come and acts on what is due.
    pub(super) fn receive(
        &mut self,
        now: u64,
        impairment: &Impairment,
        controller: &mut Controller,
        buffer: &mut [u8],
        rng: &mut ChaCha8Rng,
    ) {
        if impairment.is_deaf(now) {
            return;
        }
        let room = if now < impairment.slow.1 {
            impairment.slow.0.min(buffer.len())
        } else {
            buffer.len()
        };
        let mut quiet = true;
        if room > 0 && !self.ended {
            match self.stream.read(&mut buffer[..room]) {
                Ok(0) => self.ended = true,
                Ok(n) => {
                    quiet = false;
                    let due = now + impairment.delay(rng);
                    let due = self.incoming.back().map_or(due, |(last, _)| due.max(*last));
                    self.incoming.push_back((due, buffer[..n].to_vec()));
                }
                Err(e)
                    if matches!(
                        e.kind(),
                        io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted
                    ) => {}
                Err(_) => self.closed = true,
            }
        }
        while let Some((due, _)) = self.incoming.front()
            && *due <= now
            && !self.closed
        {
            if let Some((_, bytes)) = self.incoming.pop_front() {
                self.handle(&bytes, now, impairment, controller, rng);
            }
        }
        if let Service::Script(units) = &mut self.service
            && quiet
        {
            units.idle();
            run_scripts(units, controller);
        }
        if self.ended && self.incoming.is_empty() {
            self.closed = true;
        }
    }

    fn handle(
        &mut self,
        bytes: &[u8],
        now: u64,
        impairment: &Impairment,
        controller: &mut Controller,
        rng: &mut ChaCha8Rng,
    ) {
        self.answer.clear();
        match &mut self.service {
            Service::Rtde(session) => {
                if let Err(error) = session.receive(bytes, controller, &mut self.answer) {
                    controller.note(Severity::Warning, format!("RTDE client dropped: {error}"));
                    self.closed = true;
                }
            }
            Service::Dashboard(line) => {
                for byte in bytes {
                    if *byte != b'\n' {
                        line.push(*byte);
                        self.closed |= line.len() > LINE_MAX;
                        continue;
                    }
                    let answer = controller.dashboard(&String::from_utf8_lossy(line));
                    line.clear();
                    self.answer.extend_from_slice(answer.text.as_bytes());
                    self.answer.push(b'\n');
                    self.ended |= answer.close;
                }
            }
            Service::Script(units) => {
                units.push(bytes);
                run_scripts(units, controller);
            }
        }
        self.outgoing.push(now + impairment.delay(rng), &self.answer);
        if self.ended || self.closed {
            // Say the last word before the door closes.
            _ = self.outgoing.flush(u64::MAX, 0, &mut self.stream);
        }
    }

    /// Writes answers, and on RTDE the cycle's data.
    pub(super) fn send(
        &mut self,
        now: u64,
        impairment: &Impairment,
        controller: &Controller,
        rng: &mut ChaCha8Rng,
    ) {
        if self.closed {
            return;
        }
        let mute = now < impairment.mute_until;
        // Only the latest data matter: a client that lags, or cannot hear, loses cycles and gets none late.
        if let Service::Rtde(session) = &mut self.service
            && !mute
            && !self.outgoing.is_blocked()
        {
            self.answer.clear();
            session.data(controller, &mut self.answer);
            self.outgoing.push(now + impairment.delay(rng), &self.answer);
        }
        let (group, merging) = impairment.merge;
        let waits = now < merging && !now.is_multiple_of(group.max(1));
        if mute || waits {
            return;
        }
        // Another place each time, so that in time every byte is a seam.
        let hold_back = if now < impairment.split_until { rng.random_range(1..64) } else { 0 };
        match self.outgoing.flush(now, hold_back, &mut self.stream) {
            Ok(n) if n > 0 || self.outgoing.is_empty() => self.moved = now,
            Ok(_) => self.closed |= now - self.moved > ticks(UNREAD_MAX),
            Err(_) => self.closed = true,
        }
    }
}

fn run_scripts(units: &mut Units, controller: &mut Controller) {
    while let Some(unit) = units.take() {
        match unit {
            Unit::Program(text) => controller.run_script(&text),
            Unit::TooLong(bytes) => {
                controller
                    .note(Severity::Error, format!("script refused: {bytes} bytes without an end"));
            }
        }
    }
}
