//! An RTDE session over a TCP socket that is never waited for but in one place.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::UrError;
use crate::proto::{ControllerVersion, Event, Level, Recipe, Record, Session, Setup, Value};

/// Texts of the controller that are kept until someone asks for them.
const TEXTS_KEPT: usize = 32;

/// Reads after the deadline that may still find something: a thread that was held up catches up first.
const LATE_READS: u32 = 64;

/// A blocking RTDE client: one connection, one output recipe, any input recipes.
///
/// After any error but a time-out the connection is of no more use.
#[derive(Debug)]
pub struct RtdeClient {
    stream: TcpStream,
    session: Session,
    epoch: Instant,
    texts: Vec<(Level, String)>,
    /// When the last wait ended, or was found not to be needed.
    woken: Instant,
}

impl RtdeClient {
    /// Connects, agrees on version 2, sets the recipes up and starts the data.
    ///
    /// # Errors
    ///
    /// No connection; another protocol or version; all outputs that the controller lacks and all inputs
    /// that another client owns, by name.
    pub fn connect(host: &str, port: u16, setup: Setup) -> Result<Self, UrError> {
        let timeout = setup.timeout;
        let stream = connect("RTDE", host, port, timeout)?;
        stream.set_nonblocking(true)?;
        let session = Session::new(setup, Duration::ZERO)?;
        let mut client = Self {
            stream,
            session,
            epoch: Instant::now(),
            texts: Vec::new(),
            woken: Instant::now(),
        };
        while !client.session.is_running() {
            client.flush()?;
            // The session's own deadline decides; this only wakes up for it.
            client.wait(Instant::now() + Duration::from_millis(20))?;
            let now = client.epoch.elapsed();
            // Data that came with the start is not lost: the next packet is 2 ms away.
            client.fill()?;
            while !client.session.is_running() && client.step(&mut |_| {})? {}
            client.session.poll(now)?;
        }
        Ok(client)
    }

    /// Waits for data until `deadline`, then hands over every data packet that has arrived, oldest first.
    /// Returns how many there were: 0 after the deadline.
    pub fn receive(
        &mut self,
        deadline: Instant,
        mut each: impl FnMut(Record<'_>),
    ) -> Result<usize, UrError> {
        let (mut count, mut late) = (0, 0);
        self.woken = Instant::now();
        loop {
            while self.step(&mut |record| {
                count += 1;
                each(record);
            })? {}
            // One more look at the socket: only the newest packet is of use.
            if self.fill()? > 0 {
                late += u32::from(Instant::now() >= deadline);
                // Whoever sends faster than this reads is not a controller.
                if late > LATE_READS {
                    return Ok(count);
                }
                continue;
            }
            if count > 0 || !self.wait(deadline)? {
                return Ok(count);
            }
            self.woken = Instant::now();
        }
    }

    /// Sends values of an input recipe without ever waiting. `Ok(false)`: the network takes nothing more,
    /// the values are dropped.
    pub fn write(&mut self, recipe: usize, values: &[Value]) -> Result<bool, UrError> {
        self.flush()?;
        let taken = self.session.write(recipe, values)?;
        self.flush()?;
        Ok(taken)
    }

    /// When the data of the last [`receive`](Self::receive) was there for it: what came after is this computer's own
    /// time.
    pub fn woken(&self) -> Instant {
        self.woken
    }

    /// The controller's software.
    pub fn controller(&self) -> ControllerVersion {
        self.session.controller()
    }

    /// The outputs as the controller granted them.
    pub fn outputs(&self) -> &Recipe {
        self.session.outputs()
    }

    /// Texts that the controller has sent since the last call, at most 32 of them.
    pub fn take_texts(&mut self) -> Vec<(Level, String)> {
        std::mem::take(&mut self.texts)
    }

    /// One event; `false` if more bytes are needed.
    fn step(&mut self, each: &mut impl FnMut(Record<'_>)) -> Result<bool, UrError> {
        match self.session.next_event(self.epoch.elapsed())? {
            None => return Ok(false),
            Some(Event::Data(record)) => each(record),
            Some(Event::Text(text)) if self.texts.len() < TEXTS_KEPT => {
                self.texts.push((text.level, text.message.into_owned()));
            }
            Some(_) => {}
        }
        Ok(true)
    }

    /// Reads what has arrived. Without waiting.
    fn fill(&mut self) -> Result<usize, UrError> {
        loop {
            match self.stream.read(self.session.space()) {
                Ok(0) => return Err(UrError::Closed),
                Ok(n) => {
                    self.session.filled(n);
                    return Ok(n);
                }
                Err(e) if e.kind() == ErrorKind::WouldBlock => return Ok(0),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(e.into()),
            }
        }
    }

    fn flush(&mut self) -> Result<(), UrError> {
        while !self.session.outgoing().is_empty() {
            match self.stream.write(self.session.outgoing()) {
                Ok(n) => self.session.sent(n),
                Err(e) if e.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(e.into()),
            }
        }
        Ok(())
    }

    /// Whether there is something to read before `deadline`.
    fn wait(&self, deadline: Instant) -> Result<bool, UrError> {
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let timeout = Timespec {
                tv_sec: left.as_secs().try_into().unwrap_or(i64::MAX),
                tv_nsec: left.subsec_nanos().into(),
            };
            match poll(&mut [PollFd::new(&self.stream, PollFlags::IN)], Some(&timeout)) {
                Ok(ready) => return Ok(ready > 0),
                Err(rustix::io::Errno::INTR) => {}
                Err(e) => return Err(io::Error::from(e).into()),
            }
        }
    }
}

/// A TCP connection that sends small packets at once, to the first address that answers.
pub(crate) fn connect(
    service: &'static str,
    host: &str,
    port: u16,
    timeout: Duration,
) -> Result<TcpStream, UrError> {
    let failed = |source| UrError::Connect { service, address: format!("{host}:{port}"), source };
    let mut last = io::Error::new(ErrorKind::NotFound, "the name has no address");
    for address in (host, port).to_socket_addrs().map_err(failed)? {
        match TcpStream::connect_timeout(&address, timeout) {
            Ok(stream) => {
                stream.set_nodelay(true).map_err(failed)?;
                // Unacknowledged for this long means lost; without it the kernel waits for minutes.
                #[cfg(target_os = "linux")]
                rustix::net::sockopt::set_tcp_user_timeout(&stream, 1000)
                    .map_err(|e| failed(e.into()))?;
                return Ok(stream);
            }
            Err(e) => last = e,
        }
    }
    Err(failed(last))
}
