//! What this crate itself costs per tick.
//!
//! Run: `cargo run --release -p palpate-ur --example tick_cost -- [TICKS]`
//! You should see: percentiles of the time from a sample that is ready to be read to a command that is
//! sent, system calls included, waiting excluded.
//!
//! A thread plays the controller: it sends a sample, says so, and waits until the command is there, so that
//! every read finds exactly one sample and never waits for the network.
#![expect(clippy::print_stdout, reason = "it is the example's purpose")]

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use palpate_robot_io::{JointCommand, RobotBackend};
use palpate_ur::proto::{
    ClientPacket, ControllerVersion, DataType, Framer, Recipe, ServerPacket, Value, VariableReply,
    Version,
};
use palpate_ur::{Ports, UrArm, UrConfig};

const Q: [f64; 6] = [0.1, -1.4, 1.5, -1.6, -1.5, 0.2];
const WARM_UP: usize = 200;

fn main() -> anyhow::Result<()> {
    let ticks: usize = std::env::args().nth(1).map_or(Ok(100_000), |n| n.parse())?;
    let (rtde, script) = (TcpListener::bind("127.0.0.1:0")?, TcpListener::bind("127.0.0.1:0")?);
    let mut config = UrConfig::at("127.0.0.1");
    config.ports = Ports {
        rtde: rtde.local_addr()?.port(),
        script: script.local_addr()?.port(),
        dashboard: 1,
    };
    config.boot_settle = 0.0;
    config.stale_ticks = 500;
    config.frozen_ticks = 0;
    let (go, paced) = channel();
    let (ready, told) = channel();
    let controller = std::thread::spawn(move || controller(&rtde, &script, &paced, &ready));

    let mut arm = UrArm::connect(config)?;
    // From here on the controller sends one sample per word.
    go.send(())?;
    told.recv()?;
    let mut command = JointCommand { q: arm.sample().q() };
    let mut costs = Vec::with_capacity(ticks);
    arm.read()?;
    arm.write(&command)?;
    for n in 0..ticks + WARM_UP {
        go.send(())?;
        told.recv()?;
        command.q[5] += if n % 2 == 0 { 1e-4 } else { -1e-4 };
        let begin = Instant::now();
        let state = arm.read()?;
        std::hint::black_box(&state);
        arm.write(&command)?;
        if n >= WARM_UP {
            costs.push(begin.elapsed());
        }
    }
    costs.sort_unstable();
    let at =
        |part: f64| costs[((costs.len() - 1) as f64 * part).round() as usize].as_secs_f64() * 1e6;
    println!(
        "{ticks} ticks of read and write, µs: p50 {:.1}, p99 {:.1}, p99.9 {:.1}, p99.99 {:.1}, max {:.1}",
        at(0.5),
        at(0.99),
        at(0.999),
        at(0.9999),
        at(1.0)
    );
    println!("{:?}", arm.stats());
    drop(arm);
    drop(go);
    match controller.join() {
        Ok(outcome) => outcome,
        Err(_) => bail!("the controller's thread panicked"),
    }
}

fn type_of(name: &str) -> DataType {
    match name {
        "timestamp" | "payload" | "target_speed_fraction" | "speed_scaling" => DataType::Double,
        "runtime_state" => DataType::Uint32,
        "robot_mode" | "safety_status" => DataType::Int32,
        _ if name.contains("int_register") => DataType::Int32,
        _ if name.contains("double_register") => DataType::Double,
        _ => DataType::Vector6d,
    }
}

/// Just enough of a controller and its program for an arm that goes where it is told at once.
struct Peer {
    stream: TcpStream,
    framer: Framer,
    version: Version,
    outputs: Vec<String>,
    running: bool,
    /// mode, sequence, token.
    ints: [i32; 3],
    time: f64,
}

fn controller(
    rtde: &TcpListener,
    script: &TcpListener,
    paced: &Receiver<()>,
    ready: &Sender<()>,
) -> anyhow::Result<()> {
    let (stream, _) = rtde.accept()?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(Duration::from_millis(1)))?;
    script.set_nonblocking(true)?;
    let mut peer = Peer {
        stream,
        framer: Framer::new(),
        version: Version::V1,
        outputs: Vec::new(),
        running: false,
        ints: [0; 3],
        time: 100.0,
    };
    let (mut text, mut upload) = (String::new(), None);
    // By the clock until the arm is connected …
    while paced.try_recv().is_err() {
        peer.listen()?;
        if let Ok((stream, _)) = script.accept() {
            stream.set_nonblocking(true)?;
            upload = Some(stream);
        }
        if let Some(stream) = &mut upload {
            let _ = stream.read_to_string(&mut text);
        }
        if peer.running {
            peer.report(text.ends_with("\nend\n"))?;
        }
    }
    peer.report(true)?;
    ready.send(())?;
    // … and then one sample per command.
    let mut last = peer.ints[1];
    while paced.recv().is_ok() {
        while peer.ints[1] == last {
            peer.listen()?;
        }
        last = peer.ints[1];
        peer.report(true)?;
        ready.send(())?;
    }
    Ok(())
}

impl Peer {
    fn listen(&mut self) -> anyhow::Result<()> {
        match self.stream.read(self.framer.space()) {
            Ok(0) => bail!("the arm is gone"),
            Ok(n) => self.framer.filled(n),
            Err(_) => return Ok(()),
        }
        while let Some(frame) = self.framer.next_frame()? {
            let version = self.version;
            let reply = match ClientPacket::decode(version, frame)? {
                ClientPacket::RequestVersion(_) => {
                    self.version = Version::V2;
                    ServerPacket::VersionAccepted(true)
                }
                ClientPacket::ControllerVersion => {
                    ServerPacket::ControllerVersion(ControllerVersion {
                        major: 5,
                        minor: 17,
                        bugfix: 0,
                        build: 0,
                    })
                }
                ClientPacket::SetupOutputs { names, .. } => {
                    let types = names.iter().map(|n| VariableReply::Type(type_of(n))).collect();
                    self.outputs = names.into_iter().map(Into::into).collect();
                    ServerPacket::OutputRecipe { recipe: 1, types }
                }
                ClientPacket::SetupInputs { names } => {
                    let types = names.iter().map(|n| VariableReply::Type(type_of(n))).collect();
                    ServerPacket::InputRecipe { recipe: 1, types }
                }
                ClientPacket::Start => {
                    self.running = true;
                    ServerPacket::Started(true)
                }
                ClientPacket::Data { values, .. } => {
                    for (n, int) in self.ints.iter_mut().enumerate() {
                        let bytes = values[4 * n..].first_chunk().context("a short command")?;
                        *int = i32::from_be_bytes(*bytes);
                    }
                    continue;
                }
                ClientPacket::Text(_) | ClientPacket::Pause => continue,
            };
            let mut out = Vec::new();
            reply.encode(version, &mut out)?;
            self.stream.write_all(&out)?;
        }
        Ok(())
    }

    fn report(&mut self, playing: bool) -> anyhow::Result<()> {
        self.time += 0.002;
        let [mode, sequence, token] = self.ints;
        let program =
            if playing { [1, sequence, 1 + i32::from(mode == 1), 0, token, 0, 0] } else { [0; 7] };
        let recipe = Recipe::new(1, self.outputs.iter().map(|n| (n.as_str(), type_of(n))));
        let mut values = Vec::new();
        let mut registers = program.into_iter();
        for field in recipe.fields() {
            match field.name.as_str() {
                "timestamp" => Value::Double(self.time),
                "target_speed_fraction" => Value::Double(1.0),
                "actual_q" | "target_q" => Value::Vector6d(Q),
                "robot_mode" => Value::Int32(7),
                "safety_status" => Value::Int32(1),
                "runtime_state" => Value::Uint32(1 + u32::from(playing)),
                name if name.contains("register") => Value::Int32(registers.next().unwrap_or(0)),
                _ => field.data_type.zero(),
            }
            .write(&mut values);
        }
        let mut out = Vec::new();
        ServerPacket::Data { recipe: 1, values: &values }.encode(self.version, &mut out)?;
        Ok(self.stream.write_all(&out)?)
    }
}
