//! The server in real time, on a thread of its own or the caller's.

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use palpate_kinematics::ModelError;

use super::Server;
use crate::controller::{Controller, ControllerConfig, DT, Event};
use crate::fault::{Fault, Port, TimedFault};
use crate::plant::Plant;

/// How to run a virtual controller.
#[derive(Clone, Debug)]
pub struct Options {
    /// Where to listen.
    pub address: IpAddr,
    /// Any free ports instead of UR's numbers.
    pub any_ports: bool,
    /// The controller.
    pub controller: ControllerConfig,
    /// What goes wrong, and when.
    pub faults: Vec<TimedFault>,
}

impl Options {
    /// On the loopback interface with UR's ports, and nothing goes wrong.
    pub fn new(controller: ControllerConfig) -> Self {
        Self {
            address: Ipv4Addr::LOCALHOST.into(),
            any_ports: false,
            controller,
            faults: Vec::new(),
        }
    }
}

/// Why a virtual controller cannot run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The arm makes no sense.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A port cannot be opened.
    #[error(
        "cannot listen on {address}: {source}; another controller may be running, or choose free ports"
    )]
    Bind {
        /// Where.
        address: IpAddr,
        /// Why not.
        #[source]
        source: io::Error,
    },
}

/// How well the real-time run kept its pace.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pace {
    /// Cycles run.
    pub cycles: u64,
    /// Cycles that began more than a period late; the controller's clock then waits rather than hurries.
    pub late: u64,
    /// The latest beginning.
    pub worst: Duration,
}

/// A server that runs no cycle yet.
///
/// # Errors
/// It cannot be started.
pub fn open(options: Options, plant: Box<dyn Plant>) -> Result<Server, RunError> {
    let address = options.address;
    let controller = Controller::new(options.controller, plant)?;
    let mut server = Server::bind(controller, address, options.any_ports)
        .map_err(|source| RunError::Bind { address, source })?;
    options.faults.into_iter().for_each(|fault| server.schedule(fault));
    Ok(server)
}

/// Runs a virtual controller until `stop`; tells `report` where it listens and what happens.
///
/// # Errors
/// It cannot be started.
pub fn run(
    options: Options,
    plant: Box<dyn Plant>,
    stop: &AtomicBool,
    report: &mut dyn FnMut(&str),
) -> Result<Pace, RunError> {
    let address = options.address;
    let mut server = open(options, plant)?;
    for port in Port::ALL {
        let at = server.address(port).map_err(|source| RunError::Bind { address, source })?;
        report(&format!("{:<9} {at}", port.name()));
    }
    let mut said = |server: &mut Server| {
        let events: Vec<Event> = server.controller_mut().take_events();
        for e in &events {
            report(&format!("{:10.3} s  {}", e.time, e.text));
        }
    };
    Ok(keep_pace(&mut server, stop, &mut said))
}

/// Calls [`Server::tick`] every 2 ms.
fn keep_pace(server: &mut Server, stop: &AtomicBool, each: &mut dyn FnMut(&mut Server)) -> Pace {
    let period = Duration::from_secs_f64(DT);
    let mut pace = Pace::default();
    let mut next = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        server.tick();
        each(server);
        pace.cycles += 1;
        next += period;
        let now = Instant::now();
        if let Some(left) = next.checked_duration_since(now) {
            std::thread::sleep(left);
        } else {
            let late = now - next;
            pace.worst = pace.worst.max(late);
            if late > period {
                // Cycles in a burst would leave a client no time to answer: a controller whose host is
                // busy has a slow clock instead.
                pace.late += 1;
                next = now;
            }
        }
    }
    pace
}

type Job = Box<dyn FnOnce(&mut Server) + Send>;

/// A virtual controller on a thread of its own, for tests; dropped, it ends.
#[derive(Debug)]
pub struct Handle {
    addresses: Vec<(Port, SocketAddr)>,
    jobs: Sender<Job>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Pace>>,
}

impl Handle {
    /// Starts one.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start(options: Options, plant: Box<dyn Plant>) -> Result<Self, RunError> {
        let address = options.address;
        let mut server = open(options, plant)?;
        let addresses: Result<Vec<_>, _> =
            Port::ALL.into_iter().map(|port| server.address(port).map(|at| (port, at))).collect();
        let addresses = addresses.map_err(|source| RunError::Bind { address, source })?;
        let stop = Arc::new(AtomicBool::new(false));
        let (jobs, inbox): (Sender<Job>, Receiver<Job>) = channel();
        let end = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let mut work = |server: &mut Server| inbox.try_iter().for_each(|job| job(server));
            keep_pace(&mut server, &end, &mut work)
        });
        Ok(Self { addresses, jobs, stop, thread: Some(thread) })
    }

    /// Where a port listens.
    pub fn address(&self, port: Port) -> SocketAddr {
        let found = self.addresses.iter().find(|(p, _)| *p == port);
        found.map_or(SocketAddr::from((Ipv4Addr::LOCALHOST, port.number())), |(_, at)| *at)
    }

    /// Lets something go wrong now.
    pub fn inject(&self, fault: Fault) {
        _ = self.with(move |server| server.inject(fault));
    }

    /// Looks at or pokes the server between two cycles; `None` once it has ended.
    pub fn with<R: Send + 'static>(
        &self,
        job: impl FnOnce(&mut Server) -> R + Send + 'static,
    ) -> Option<R> {
        let (answer, result) = channel();
        let job: Job = Box::new(move |server| _ = answer.send(job(server)));
        self.jobs.send(job).ok()?;
        result.recv().ok()
    }

    /// Ends it and says how it kept its pace.
    pub fn stop(mut self) -> Pace {
        self.end()
    }

    fn end(&mut self) -> Pace {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().and_then(|thread| thread.join().ok()).unwrap_or_default()
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        self.end();
    }
}
