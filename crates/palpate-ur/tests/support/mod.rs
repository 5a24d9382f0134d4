//! A controller for tests: RTDE and script ports on loopback, one thread, faults on request.
//!
//! It follows the register protocol of the control program with a model of its own, and writes packets
//! itself where a fault needs bytes that the protocol core would not write.
#![expect(dead_code, reason = "each test binary uses its own part")]

mod program;
mod server;

use std::net::TcpListener;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use palpate_ur::{Ports, UrConfig};

pub use program::Program;

/// What goes wrong, from the next tick on.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Fault {
    #[default]
    None,
    /// Closes every RTDE connection, once.
    Cut,
    /// Neither sends nor reads.
    Dead,
    /// Sends, does not read.
    Deaf,
    /// Does not send for this many ticks.
    Silent(u32),
    /// Sends these bytes instead of data, once.
    Garbage(Vec<u8>),
    /// Writes byte by byte.
    Split,
    /// Sends the packets of several ticks at once.
    Merge(u32),
    /// Repeats each packet.
    Repeat,
    /// The clock starts again, once.
    ClockBack,
    /// This many text messages before each packet.
    Texts(u32),
}

#[derive(Debug, Default)]
pub struct World {
    pub fault: Fault,
    pub tick: u64,
    pub time: f64,
    pub q: [f64; 6],
    pub dq: [f64; 6],
    pub target: [f64; 6],
    /// What the sensor would say untared: base axes.
    pub load: [f64; 6],
    pub tare: [f64; 6],
    pub safety: i32,
    pub robot_mode: i32,
    pub runtime: u32,
    pub slider: f64,
    pub ints: Vec<i32>,
    pub doubles: Vec<f64>,
    pub out: Vec<i32>,
    pub program: Option<Program>,
    pub uploads: u32,
    pub last_upload: String,
    /// Answers version 2 with no.
    pub only_version_1: bool,
    /// Setups of inputs that are refused before one is granted.
    pub in_use: u32,
    pub missing: Vec<String>,
    /// Largest step of the target between two ticks, rad.
    pub largest_step: f64,
    /// Ticks in which the target changed.
    pub moving_ticks: u64,
    pub setups: u32,
}

pub struct Controller {
    pub world: Arc<Mutex<World>>,
    pub ports: Ports,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Controller {
    /// Runs with `speed` times the ticks of a real one; its own clock still counts 2 ms each.
    pub fn start(speed: f64) -> Self {
        let rtde = TcpListener::bind("127.0.0.1:0").unwrap();
        let script = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = |l: &TcpListener| l.local_addr().unwrap().port();
        let ports = Ports { rtde: port(&rtde), script: port(&script), dashboard: 1 };
        let q = [0.1, -1.4, 1.5, -1.6, -1.5, 0.2];
        let world = Arc::new(Mutex::new(World {
            time: 100.0,
            q,
            target: q,
            safety: 1,
            robot_mode: 7,
            runtime: 1,
            slider: 1.0,
            ints: vec![0; 48],
            doubles: vec![0.0; 48],
            out: vec![0; 48],
            ..World::default()
        }));
        let end = Arc::new(AtomicBool::new(false));
        let thread = {
            let (world, end) = (world.clone(), end.clone());
            std::thread::spawn(move || {
                let mut server = server::Server::new(rtde, script);
                let period = Duration::from_secs_f64(0.002 / speed);
                let mut next = Instant::now();
                while !end.load(Ordering::SeqCst) {
                    server.tick(&mut world.lock().unwrap());
                    next = (next + period).max(Instant::now());
                    std::thread::sleep(next.saturating_duration_since(Instant::now()));
                }
            })
        };
        Self { world, ports, end, thread: Some(thread) }
    }

    pub fn lock(&self) -> MutexGuard<'_, World> {
        self.world.lock().unwrap()
    }

    /// A look that holds the lock no longer than it takes.
    pub fn see<T>(&self, look: impl FnOnce(&World) -> T) -> T {
        look(&self.lock())
    }

    pub fn set(&self, fault: Fault) {
        self.lock().fault = fault;
    }

    /// Patient enough for a busy computer.
    pub fn config(&self) -> UrConfig {
        let mut config = UrConfig::at("127.0.0.1");
        config.ports = self.ports;
        config.stale_ticks = 100;
        config.answer_timeout = 2.0;
        config.boot_settle = 0.0;
        config
    }

    /// Waits for `done` to be true of the world.
    pub fn until(&self, mut done: impl FnMut(&World) -> bool) {
        let deadline = Instant::now() + Duration::from_secs(10);
        while !done(&self.lock()) {
            assert!(Instant::now() < deadline, "the controller did not get there");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        self.end.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            let ended = thread.join();
            assert!(ended.is_ok() || std::thread::panicking());
        }
    }
}
