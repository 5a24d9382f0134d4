//! The controller on its TCP ports.
//!
//! One thread does it all between two control cycles, with sockets that never block: a client that is slow,
//! silent or hostile cannot hold up a cycle, and a test that calls [`Server::tick`] itself has no clock in it.

mod apply;
mod link;
mod queue;
mod runner;
mod stepped;

use std::collections::BTreeMap;
use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::controller::{Controller, ticks};
use crate::fault::{Fault, Port, TimedFault};
use link::{Impairment, Link};

pub use runner::{Handle, Options, Pace, RunError, open, run};
pub use stepped::Stepped;

/// The controller and its connections.
#[derive(Debug)]
pub struct Server {
    controller: Controller,
    listeners: Vec<(Port, TcpListener)>,
    links: Vec<Link>,
    impairments: BTreeMap<Port, Impairment>,
    /// Latest first.
    faults: Vec<TimedFault>,
    occupied: Vec<(u64, String)>,
    stalled_until: u64,
    only_version_1: bool,
    next_client: u64,
    /// Cycles of the server; the controller's stand still in a stall.
    now: u64,
    rng: ChaCha8Rng,
    bytes: Vec<u8>,
}

impl Server {
    /// Opens the ports on `address`: UR's numbers, or any free ones.
    ///
    /// # Errors
    /// A port is taken.
    pub fn bind(controller: Controller, address: IpAddr, any_ports: bool) -> io::Result<Self> {
        let mut listeners = Vec::new();
        for port in Port::ALL {
            let number = if any_ports { 0 } else { port.number() };
            let listener = TcpListener::bind((address, number))?;
            listener.set_nonblocking(true)?;
            listeners.push((port, listener));
        }
        Ok(Self {
            rng: ChaCha8Rng::seed_from_u64(controller.config.seed),
            controller,
            listeners,
            links: Vec::new(),
            impairments: BTreeMap::new(),
            faults: Vec::new(),
            occupied: Vec::new(),
            stalled_until: 0,
            only_version_1: false,
            next_client: 1,
            now: 0,
            bytes: vec![0; 64 * 1024],
        })
    }

    /// Where a port listens.
    ///
    /// # Errors
    /// The operating system does not say.
    pub fn address(&self, port: Port) -> io::Result<SocketAddr> {
        let found = self.listeners.iter().find(|(p, _)| *p == port);
        found.ok_or(io::ErrorKind::NotFound)?.1.local_addr()
    }

    /// The controller.
    pub fn controller(&self) -> &Controller {
        &self.controller
    }

    /// The controller, to be poked by tests.
    pub fn controller_mut(&mut self) -> &mut Controller {
        &mut self.controller
    }

    /// Connections now open to a port.
    pub fn connections(&self, port: Port) -> usize {
        self.links.iter().filter(|l| l.port == port).count()
    }

    /// Lets something go wrong later.
    pub fn schedule(&mut self, fault: TimedFault) {
        self.faults.push(fault);
        self.faults.sort_by(|a, b| b.at.total_cmp(&a.at));
    }

    /// Lets something go wrong in the next cycle.
    pub fn inject(&mut self, fault: Fault) {
        self.schedule(TimedFault { at: 0.0, fault });
    }

    /// One control cycle with everything that came in since the last, and everything that goes out.
    pub fn tick(&mut self) {
        self.now += 1;
        while self.faults.last().is_some_and(|f| ticks(f.at) <= self.now) {
            if let Some(timed) = self.faults.pop() {
                self.apply(timed.fault);
            }
        }
        let (now, registers) = (self.now, &mut self.controller.registers);
        self.occupied.retain(|(until, name)| {
            let ends = now >= *until;
            if ends {
                registers.occupy(name, false);
            }
            !ends
        });
        if self.now < self.stalled_until {
            return;
        }
        self.accept();
        for link in &mut self.links {
            let impairment = self.impairments.get(&link.port).copied().unwrap_or_default();
            link.receive(
                self.now,
                &impairment,
                &mut self.controller,
                &mut self.bytes,
                &mut self.rng,
            );
        }
        self.controller.tick();
        for link in &mut self.links {
            let impairment = self.impairments.get(&link.port).copied().unwrap_or_default();
            link.send(self.now, &impairment, &self.controller, &mut self.rng);
        }
        let controller = &mut self.controller;
        self.links.retain_mut(|link| {
            if link.closed {
                link.end(controller);
            }
            !link.closed
        });
    }

    fn accept(&mut self) {
        for (port, listener) in &self.listeners {
            let impairment = self.impairments.get(port).copied().unwrap_or_default();
            if impairment.is_deaf(self.now) {
                continue;
            }
            while let Ok((stream, _)) = listener.accept() {
                if self.links.len() >= Link::COUNT_MAX {
                    continue;
                }
                let client = self.next_client;
                self.next_client += 1;
                if let Ok(mut link) = Link::new(*port, stream, client, self.now) {
                    if self.only_version_1 {
                        link.speak_version_1();
                    }
                    self.links.push(link);
                }
            }
        }
    }
}
