//! A controller for tests: RTDE and script ports on loopback, one thread, faults on request.
//!
//! It follows the register protocol of the control program with a model of its own, and writes packets
//! itself where a fault needs bytes that the protocol core would not write.
#![expect(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

pub(crate) mod moves;
mod program;
mod server;

use std::net::TcpListener;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use palpate_ur::{Ports, UrConfig};

pub(crate) use program::Program;

/// What goes wrong, from the next tick on.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) enum Fault {
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
pub(crate) struct World {
    pub(crate) fault: Fault,
    pub(crate) tick: u64,
    pub(crate) time: f64,
    pub(crate) q: [f64; 6],
    pub(crate) dq: [f64; 6],
    pub(crate) target: [f64; 6],
    /// What the sensor would say untared: base axes.
    pub(crate) load: [f64; 6],
    pub(crate) tare: [f64; 6],
    pub(crate) safety: i32,
    pub(crate) robot_mode: i32,
    pub(crate) runtime: u32,
    pub(crate) slider: f64,
    pub(crate) ints: Vec<i32>,
    pub(crate) doubles: Vec<f64>,
    pub(crate) out: Vec<i32>,
    pub(crate) program: Option<Program>,
    pub(crate) uploads: u32,
    pub(crate) last_upload: String,
    /// Answers version 2 with no.
    pub(crate) only_version_1: bool,
    /// Setups of inputs that are refused before one is granted.
    pub(crate) in_use: u32,
    pub(crate) missing: Vec<String>,
    /// Largest step of the target between two ticks, rad.
    pub(crate) largest_step: f64,
    /// Ticks in which the target changed.
    pub(crate) moving_ticks: u64,
    pub(crate) setups: u32,
}

pub(crate) struct Controller {
    pub(crate) world: Arc<Mutex<World>>,
    pub(crate) ports: Ports,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Controller {
    /// Runs with `speed` times the ticks of a real one; its own clock still counts 2 ms each.
    pub(crate) fn start(speed: f64) -> Self {
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

    pub(crate) fn lock(&self) -> MutexGuard<'_, World> {
        self.world.lock().unwrap()
    }

    /// A look that holds the lock no longer than it takes.
    pub(crate) fn see<T>(&self, look: impl FnOnce(&World) -> T) -> T {
        look(&self.lock())
    }

    pub(crate) fn set(&self, fault: Fault) {
        self.lock().fault = fault;
    }

    /// Patient enough for a busy computer.
    pub(crate) fn config(&self) -> UrConfig {
        let mut config = UrConfig::at("127.0.0.1");
        config.ports = self.ports;
        config.stale_ticks = 100;
        config.stall_ticks = 50;
        config.answer_timeout = 2.0;
        config.boot_settle = 0.0;
        // Its sensor has no noise.
        config.frozen_ticks = 0;
        config
    }

    /// Waits for `done` to be true of the world.
    pub(crate) fn until(&self, mut done: impl FnMut(&World) -> bool) {
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
