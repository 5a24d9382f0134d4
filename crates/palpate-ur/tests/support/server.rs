//! The server's side of RTDE and of the script port.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};

use palpate_ur::proto::*;

use super::{Fault, Program, World, program};

pub(crate) struct Server {
    rtde: TcpListener,
    script: TcpListener,
    clients: Vec<Client>,
    uploads: Vec<(TcpStream, String)>,
    silent: u32,
}

struct Client {
    stream: TcpStream,
    framer: Framer,
    version: Version,
    out: Vec<u8>,
    outputs: Option<Recipe>,
    inputs: Vec<Recipe>,
    running: bool,
    gone: bool,
}

fn type_of(name: &str) -> Option<DataType> {
    Some(match name {
        "timestamp" | "payload" | "target_speed_fraction" | "speed_scaling" => DataType::Double,
        "actual_q" | "actual_qd" | "target_q" | "actual_TCP_pose" | "actual_TCP_force"
        | "tcp_offset" => DataType::Vector6d,
        "robot_mode" | "safety_status" => DataType::Int32,
        "runtime_state" => DataType::Uint32,
        _ if name.contains("int_register_") => DataType::Int32,
        _ if name.contains("double_register_") => DataType::Double,
        _ => return None,
    })
}

fn register(name: &str) -> usize {
    name.rsplit('_').next().and_then(|n| n.parse().ok()).unwrap()
}

fn value(world: &World, name: &str) -> Value {
    let down = [0.3, 0.1, 0.2, std::f64::consts::PI, 0.0, 0.0];
    match name {
        "timestamp" => Value::Double(world.time),
        "payload" => Value::Double(0.0),
        "target_speed_fraction" | "speed_scaling" => Value::Double(world.slider),
        "actual_q" => Value::Vector6d(world.q),
        "actual_qd" => Value::Vector6d(world.dq),
        "target_q" => Value::Vector6d(world.target),
        "actual_TCP_pose" => Value::Vector6d(down),
        "actual_TCP_force" => {
            Value::Vector6d(std::array::from_fn(|n| world.load[n] - world.tare[n]))
        }
        "tcp_offset" => Value::Vector6d([0.0; 6]),
        "robot_mode" => Value::Int32(world.robot_mode),
        "safety_status" => Value::Int32(world.safety),
        "runtime_state" => Value::Uint32(world.runtime),
        _ => Value::Int32(world.out[register(name)]),
    }
}

impl Server {
    pub(crate) fn new(rtde: TcpListener, script: TcpListener) -> Self {
        rtde.set_nonblocking(true).unwrap();
        script.set_nonblocking(true).unwrap();
        Self { rtde, script, clients: vec![], uploads: vec![], silent: 0 }
    }

    pub(crate) fn tick(&mut self, world: &mut World) {
        self.accept();
        if !matches!(world.fault, Fault::Dead | Fault::Deaf) {
            for client in &mut self.clients {
                client.serve(world);
            }
        }
        self.load(world);
        physics(world);
        match world.fault.clone() {
            Fault::Cut => {
                self.clients.clear();
                world.fault = Fault::None;
            }
            Fault::Silent(ticks) => {
                self.silent = ticks;
                world.fault = Fault::None;
            }
            Fault::ClockBack => {
                world.time = 0.002;
                world.fault = Fault::None;
            }
            _ => {}
        }
        let hold =
            matches!(world.fault, Fault::Merge(n) if !world.tick.is_multiple_of(u64::from(n)));
        let quiet = self.silent > 0 || world.fault == Fault::Dead;
        self.silent = self.silent.saturating_sub(1);
        for client in &mut self.clients {
            if !quiet {
                client.report(world);
            }
            if world.fault != Fault::Dead && !hold {
                client.flush(world.fault == Fault::Split);
            }
        }
        if matches!(world.fault, Fault::Garbage(_)) && self.clients.iter().any(|c| c.running) {
            world.fault = Fault::None;
        }
        self.clients.retain(|client| !client.gone);
    }

    fn accept(&mut self) {
        while let Ok((stream, _)) = self.rtde.accept() {
            stream.set_nonblocking(true).unwrap();
            stream.set_nodelay(true).unwrap();
            self.clients.push(Client {
                stream,
                framer: Framer::new(),
                version: Version::V1,
                out: vec![],
                outputs: None,
                inputs: vec![],
                running: false,
                gone: false,
            });
        }
        while let Ok((stream, _)) = self.script.accept() {
            stream.set_nonblocking(true).unwrap();
            self.uploads.push((stream, String::new()));
        }
    }

    /// Starts a program once its last line is there, as the secondary interface does.
    fn load(&mut self, world: &mut World) {
        self.uploads.retain_mut(|(stream, text)| {
            let mut bytes = [0; 4096];
            let open = loop {
                match stream.read(&mut bytes) {
                    Ok(0) => break false,
                    Ok(n) => text.push_str(&String::from_utf8_lossy(&bytes[..n])),
                    Err(e) => break e.kind() == ErrorKind::WouldBlock,
                }
            };
            // The interface streams state that nobody asked for.
            let _ = stream.write(&[0; 700]);
            if text.ends_with("\nend\n") {
                world.last_upload = std::mem::take(text);
                world.uploads += 1;
                world.program = Program::from_text(&world.last_upload);
                assert!(world.program.is_some(), "not the control program");
                world.runtime = 2;
                world.target = world.q;
            }
            open
        });
    }
}

/// The joints follow their goal behind a lag, unless the arm is stopped.
fn physics(world: &mut World) {
    world.tick += 1;
    world.time += 0.002;
    let before = world.target;
    if world.safety == 1 && world.runtime == 2 {
        program::cycle(world);
    } else {
        // A stopped controller kills the program.
        world.program = None;
        world.target = world.q;
        world.runtime = 1;
    }
    let step = before.iter().zip(&world.target).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    world.largest_step = world.largest_step.max(step);
    world.moving_ticks += u64::from(step > 0.0);
    for n in 0..6 {
        let step = (world.target[n] - world.q[n]) * 0.2;
        world.q[n] += step;
        world.dq[n] = step / 0.002;
    }
}

impl Client {
    fn serve(&mut self, world: &mut World) {
        loop {
            match self.stream.read(self.framer.space()) {
                Ok(0) => return self.gone = true,
                Ok(n) => self.framer.filled(n),
                Err(e) if e.kind() == ErrorKind::WouldBlock => return,
                Err(_) => return self.gone = true,
            }
            let mut framer = std::mem::take(&mut self.framer);
            while let Some(frame) = framer.next_frame().unwrap() {
                let packet = ClientPacket::decode(self.version, frame).unwrap();
                self.answer(world, packet);
            }
            self.framer = framer;
        }
    }

    fn answer(&mut self, world: &mut World, packet: ClientPacket<'_>) {
        let version = self.version;
        let reply = match packet {
            ClientPacket::RequestVersion(n) => {
                let accepted = n == 2 && !world.only_version_1;
                if accepted {
                    self.version = Version::V2;
                }
                ServerPacket::VersionAccepted(accepted)
            }
            ClientPacket::ControllerVersion => ServerPacket::ControllerVersion(ControllerVersion {
                major: 5,
                minor: 17,
                bugfix: 0,
                build: 1,
            }),
            ClientPacket::SetupOutputs { names, .. } => {
                world.setups += 1;
                let types: Vec<_> = names
                    .iter()
                    .map(|name| match type_of(name) {
                        Some(t) if !world.missing.iter().any(|m| m == name) => {
                            VariableReply::Type(t)
                        }
                        _ => VariableReply::NotFound,
                    })
                    .collect();
                self.outputs = Recipe::granted(1, &names, &types).ok();
                let recipe = self.outputs.as_ref().map_or(0, Recipe::id);
                ServerPacket::OutputRecipe { recipe, types }
            }
            ClientPacket::SetupInputs { names } => {
                let busy = world.in_use > 0;
                world.in_use = world.in_use.saturating_sub(1);
                let types: Vec<_> = names
                    .iter()
                    .map(|name| match type_of(name) {
                        Some(t) if !busy => VariableReply::Type(t),
                        _ => VariableReply::InUse,
                    })
                    .collect();
                let id = self.inputs.len() as u8 + 1;
                let granted = Recipe::granted(id, &names, &types).ok();
                self.inputs.extend(granted.clone());
                ServerPacket::InputRecipe { recipe: granted.map_or(0, |r| r.id()), types }
            }
            ClientPacket::Start => {
                self.running = self.outputs.is_some();
                ServerPacket::Started(self.running)
            }
            ClientPacket::Pause => {
                self.running = false;
                ServerPacket::Paused(true)
            }
            ClientPacket::Data { recipe, values } => {
                let recipe = &self.inputs[usize::from(recipe) - 1];
                for (field, value) in recipe.fields().iter().zip(recipe.values(values).unwrap()) {
                    match value {
                        Value::Int32(n) => world.ints[register(&field.name)] = n,
                        Value::Double(x) => world.doubles[register(&field.name)] = x,
                        _ => {}
                    }
                }
                return;
            }
            ClientPacket::Text(_) => return,
        };
        reply.encode(version, &mut self.out).unwrap();
    }

    fn report(&mut self, world: &World) {
        let (true, Some(recipe)) = (self.running, &self.outputs) else { return };
        if let Fault::Garbage(bytes) = &world.fault {
            self.out.extend(bytes);
            return;
        }
        if let Fault::Texts(count) = world.fault {
            for _ in 0..count {
                let text = Text {
                    message: "é".repeat(100).into(),
                    source: "x".into(),
                    level: Level::Warning,
                };
                ServerPacket::Text(text).encode(self.version, &mut self.out).unwrap();
            }
        }
        let mut values = vec![];
        for field in recipe.fields() {
            value(world, &field.name).write(&mut values);
        }
        for _ in 0..=u8::from(world.fault == Fault::Repeat) {
            let packet = ServerPacket::Data { recipe: recipe.id(), values: &values };
            packet.encode(self.version, &mut self.out).unwrap();
        }
        // A client that does not read is dropped sooner or later.
        self.gone |= self.out.len() > 4 << 20;
    }

    fn flush(&mut self, split: bool) {
        while !self.out.is_empty() {
            let end = if split { 1 } else { self.out.len() };
            match self.stream.write(&self.out[..end]) {
                Ok(n) => drop(self.out.drain(..n)),
                Err(e) if e.kind() == ErrorKind::WouldBlock => return,
                Err(_) => return self.gone = true,
            }
        }
    }
}
