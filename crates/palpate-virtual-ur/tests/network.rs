//! The controller on loopback sockets, ticked by the test: no clock, so that faults hit the cycle they are meant for.

#![expect(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpStream};

use palpate_kinematics::UrModel;
use palpate_ur::proto::{RuntimeState, SafetyStatus};
use palpate_virtual_ur::{
    Controller, ControllerConfig, Fault, LaggedArm, LinkFault, Port, Server, TimedFault,
};

fn server() -> Server {
    let home = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0].into();
    let robot =
        Controller::new(ControllerConfig::new(UrModel::Ur3e), Box::new(LaggedArm::at(home)))
            .unwrap();
    Server::bind(robot, Ipv4Addr::LOCALHOST.into(), true).unwrap()
}

fn connect(server: &mut Server, port: Port) -> TcpStream {
    let before = server.connections(port);
    let stream = TcpStream::connect(server.address(port).unwrap()).unwrap();
    stream.set_nonblocking(true).unwrap();
    stream.set_nodelay(true).unwrap();
    for _ in 0..10_000 {
        server.tick();
        if server.connections(port) > before {
            return stream;
        }
    }
    panic!("not accepted");
}

/// What the client has received, and whether the connection is over.
fn received(stream: &mut TcpStream) -> (Vec<u8>, Option<ErrorKind>) {
    let (mut bytes, mut chunk) = (Vec::new(), [0; 16384]);
    loop {
        match stream.read(&mut chunk) {
            Ok(0) => return (bytes, Some(ErrorKind::UnexpectedEof)),
            Ok(n) => bytes.extend_from_slice(&chunk[..n]),
            Err(e) if e.kind() == ErrorKind::WouldBlock => return (bytes, None),
            Err(e) => return (bytes, Some(e.kind())),
        }
    }
}

/// Ticks until the client has at least `count` bytes.
fn until(server: &mut Server, stream: &mut TcpStream, count: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    for _ in 0..20_000 {
        server.tick();
        bytes.extend(received(stream).0);
        if bytes.len() >= count {
            return bytes;
        }
    }
    panic!("{} of {count} bytes", bytes.len());
}

const HANDSHAKE: &[u8] =
    b"\0\x05V\0\x02\0\x14O\x40\x7f\x40\0\0\0\0\0timestamp\0\x18Iinput_int_register_24\0\x03S";
/// Answers to the handshake; then 12-byte packets of time stamps.
const ANSWERS: usize = 4 + 10 + 9 + 4;
const PACKET: usize = 12;

/// A client that receives time stamps at 500 Hz and owns a register.
fn streaming(server: &mut Server) -> TcpStream {
    let mut client = connect(server, Port::Rtde);
    client.write_all(HANDSHAKE).unwrap();
    let bytes = until(server, &mut client, ANSWERS + PACKET);
    assert_eq!(bytes[ANSWERS..ANSWERS + 4], *b"\0\x0cU\x01");
    client
}

/// The time stamps in a stream of whole packets.
fn stamps(bytes: &[u8]) -> Vec<f64> {
    assert_eq!(bytes.len() % PACKET, 0, "{} bytes", bytes.len());
    let packets = bytes.chunks(PACKET);
    packets
        .map(|p| {
            assert_eq!(p[..4], *b"\0\x0cU\x01");
            f64::from_be_bytes(p[4..].try_into().unwrap())
        })
        .collect()
}

fn link(server: &mut Server, fault: LinkFault) {
    server.inject(Fault::Link(Port::Rtde, fault));
}

/// Ticks one cycle at a time and reads what each brings.
fn cycles(server: &mut Server, client: &mut TcpStream, n: usize) -> Vec<Vec<u8>> {
    (0..n)
        .map(|_| {
            server.tick();
            received(client).0
        })
        .collect()
}

#[test]
fn every_cycle_brings_a_time_stamp() {
    let mut server = server();
    let mut client = streaming(&mut server);
    let all = cycles(&mut server, &mut client, 1000).concat();
    let stamps = stamps(&all);
    assert_eq!(stamps.len(), 1000);
    assert!(stamps.windows(2).all(|w| (w[1] - w[0] - 0.002).abs() < 1e-9));
}

#[test]
fn scripts_are_taken_on_all_three_ports() {
    let mut server = server();
    for (n, port) in [(1, Port::Primary), (2, Port::Secondary), (3, Port::RealTime)] {
        let mut client = connect(&mut server, port);
        // In two segments, and the last line without its newline.
        let text = format!(
            "def f():\n write_output_integer_register(25, {n})\n while True: sync() end\nend"
        );
        let (head, tail) = text.split_at(20);
        client.write_all(head.as_bytes()).unwrap();
        (0..5).for_each(|_| server.tick());
        client.write_all(tail.as_bytes()).unwrap();
        for _ in 0..1000 {
            server.tick();
            if server.controller().registers().output.ints[25] == n {
                break;
            }
        }
        assert_eq!(server.controller().registers().output.ints[25], n, "{port:?}");
        assert_eq!(server.controller().runtime(), RuntimeState::Playing);
    }
}

#[test]
fn dashboard_lines_split_and_merged() {
    let mut server = server();
    let mut client = connect(&mut server, Port::Dashboard);
    let greeting = until(&mut server, &mut client, 45);
    assert_eq!(greeting, b"Connected: Universal Robots Dashboard Server\n");
    client.write_all(b"robot").unwrap();
    (0..5).for_each(|_| server.tick());
    client.write_all(b"mode\nsafetystatus\r\nquit\n").unwrap();
    let answer = b"Robotmode: RUNNING\nSafetystatus: NORMAL\nDisconnected\n";
    assert_eq!(until(&mut server, &mut client, answer.len()), answer);
    assert_eq!(server.connections(Port::Dashboard), 0);
    // A line without an end ends the connection.
    let mut hostile = connect(&mut server, Port::Dashboard);
    hostile.write_all(&[b'x'; 10_000]).unwrap();
    (0..100).for_each(|_| server.tick());
    assert_eq!(server.connections(Port::Dashboard), 0);
}

#[test]
fn fin_and_rst_end_a_connection_and_free_its_inputs() {
    for (fault, end) in [
        (LinkFault::Drop, ErrorKind::UnexpectedEof),
        (LinkFault::Reset, ErrorKind::ConnectionReset),
    ] {
        let mut server = server();
        let mut client = streaming(&mut server);
        server.schedule(TimedFault { at: 0.5, fault: Fault::Link(Port::Rtde, fault) });
        let mut over = None;
        for _ in 0..300 {
            server.tick();
            over = over.or(received(&mut client).1);
        }
        assert_eq!(over, Some(end));
        assert_eq!(server.connections(Port::Rtde), 0);
        // The same input again, at once.
        streaming(&mut server);
    }
}

#[test]
fn a_client_that_closes_frees_its_inputs() {
    let mut server = server();
    for _ in 0..20 {
        drop(streaming(&mut server));
        for _ in 0..1000 {
            server.tick();
            if server.connections(Port::Rtde) == 0 {
                break;
            }
        }
        assert_eq!(server.connections(Port::Rtde), 0);
    }
}

#[test]
fn a_pulled_cable_is_silence_and_then_the_newest_data_only() {
    let mut server = server();
    let mut client = streaming(&mut server);
    link(&mut server, LinkFault::HalfOpen(1.0));
    let silent = cycles(&mut server, &mut client, 499).concat();
    assert!(silent.is_empty(), "{} bytes", silent.len());
    let after = cycles(&mut server, &mut client, 10).concat();
    let after = stamps(&after);
    let last = server.controller().time();
    assert!(
        after.len() >= 8 && after.len() <= 11 && (after.last().unwrap() - last).abs() < 1e-9,
        "{after:?}"
    );
    // Nobody gets in through a cut cable.
    link(&mut server, LinkFault::HalfOpen(1.0));
    server.tick();
    let _waiting = TcpStream::connect(server.address(Port::Rtde).unwrap()).unwrap();
    (0..50).for_each(|_| server.tick());
    assert_eq!(server.connections(Port::Rtde), 1);
}

#[test]
fn one_way_loss_in_each_direction() {
    let data = |value: i32| [&b"\0\x08U\x01"[..], &value.to_be_bytes()].concat();
    let mut server = server();
    let mut client = streaming(&mut server);
    let register = |server: &Server| server.controller().registers().input.ints[24];
    // Deaf: data still come, commands arrive late, all at once.
    link(&mut server, LinkFault::Deaf(0.1));
    server.tick();
    client.write_all(&data(1)).unwrap();
    client.write_all(&data(2)).unwrap();
    let stream = cycles(&mut server, &mut client, 48).concat();
    assert!(stamps(&stream).len() >= 48 && register(&server) == 0);
    cycles(&mut server, &mut client, 5);
    assert_eq!(register(&server), 2);
    // Mute: commands still arrive, nothing comes back.
    link(&mut server, LinkFault::Mute(0.1));
    server.tick();
    client.write_all(&data(3)).unwrap();
    assert!(cycles(&mut server, &mut client, 48).concat().is_empty());
    assert_eq!(register(&server), 3);
}

#[test]
fn a_stall_stops_the_clock() {
    let mut server = server();
    let mut client = streaming(&mut server);
    let before = server.controller().ticks();
    server.inject(Fault::Stall(0.5));
    assert!(cycles(&mut server, &mut client, 250).concat().is_empty());
    assert_eq!(server.controller().ticks(), before);
    assert_eq!(stamps(&cycles(&mut server, &mut client, 10).concat()).len(), 10);
}

#[test]
fn split_and_merged_packets_are_the_same_packets() {
    let mut server = server();
    let mut client = streaming(&mut server);
    link(&mut server, LinkFault::Split(1.0));
    let parts = cycles(&mut server, &mut client, 500);
    let cut = parts.iter().filter(|p| p.len() % PACKET != 0).count();
    assert!(cut > 200, "{cut} cycles ended inside a packet");
    let all = [parts.concat(), cycles(&mut server, &mut client, 5).concat()].concat();
    let times = stamps(&all);
    assert!(times.len() > 480 && times.windows(2).all(|w| w[1] > w[0]), "{}", times.len());

    link(&mut server, LinkFault::Merge(10, 1.0));
    let groups = cycles(&mut server, &mut client, 500);
    let together = groups.iter().filter(|g| g.len() == 10 * PACKET).count();
    assert!(together >= 48, "{together}");
    assert!(groups.iter().filter(|g| g.is_empty()).count() >= 440);
}

#[test]
fn latency_and_jitter_keep_the_order() {
    let mut server = server();
    let mut client = streaming(&mut server);
    link(&mut server, LinkFault::Latency(0.02, 0.01));
    cycles(&mut server, &mut client, 50);
    let mut ages = Vec::new();
    let mut last = 0.0;
    for _ in 0..500 {
        server.tick();
        for stamp in stamps(&received(&mut client).0) {
            assert!(stamp > last);
            last = stamp;
            ages.push(server.controller().time() - stamp);
        }
    }
    let (low, high) = ages.iter().fold((f64::MAX, 0.0f64), |(l, h), a| (l.min(*a), h.max(*a)));
    // TCP keeps order: a packet behind a late one is late too, so that ages crowd at the upper end.
    assert!(low > 0.009 && high < 0.0321 && high - low > 0.004, "{low} to {high}");
}

#[test]
fn garbage_headers_and_texts_reach_the_client() {
    let mut server = server();
    let mut client = streaming(&mut server);
    link(&mut server, LinkFault::Garbage(100));
    let noise = cycles(&mut server, &mut client, 1).concat();
    assert_eq!(noise.len(), 100 + PACKET);
    for (size, kind) in [(0, b'U'), (2, b'U'), (65535, b'U'), (4, b'U')] {
        link(&mut server, LinkFault::Header(size, kind));
        let bytes = cycles(&mut server, &mut client, 1).concat();
        assert_eq!(bytes[..3], [size.to_be_bytes()[0], size.to_be_bytes()[1], kind]);
    }
    link(&mut server, LinkFault::TextFlood(50));
    let texts = cycles(&mut server, &mut client, 1).concat();
    assert_eq!(texts.windows(9).filter(|w| w.starts_with(b"message ")).count(), 50);
}

#[test]
fn in_use_for_a_while_then_free() {
    let mut server = server();
    server.inject(Fault::InUse("input_int_register_24".into(), 0.1));
    server.tick();
    let mut client = connect(&mut server, Port::Rtde);
    client.write_all(b"\0\x18Iinput_int_register_24").unwrap();
    assert_eq!(until(&mut server, &mut client, 10), b"\0\x0aI\0IN_USE");
    cycles(&mut server, &mut client, 60);
    client.write_all(b"\0\x18Iinput_int_register_24").unwrap();
    assert_eq!(until(&mut server, &mut client, 9), b"\0\x09I\x01INT32");
}

#[test]
fn an_old_controller_and_a_reboot() {
    let mut server = server();
    server.inject(Fault::OnlyVersion1);
    server.tick();
    let mut client = connect(&mut server, Port::Rtde);
    client.write_all(b"\0\x05V\0\x02").unwrap();
    assert_eq!(until(&mut server, &mut client, 4), b"\0\x04V\0");
    assert!(server.controller().time() > 0.0);
    server.inject(Fault::Reboot);
    server.tick();
    assert_eq!(server.connections(Port::Rtde), 0);
    assert!(server.controller().time() < 0.01, "{}", server.controller().time());
    assert_eq!(server.controller_mut().dashboard("robotmode").text, "Robotmode: POWER_OFF");
}

#[test]
fn a_slow_reader_takes_its_bytes_one_by_one() {
    let mut server = server();
    let mut client = streaming(&mut server);
    link(&mut server, LinkFault::SlowReader(1, 10.0));
    server.tick();
    client.write_all(&[&b"\0\x08U\x01"[..], &7i32.to_be_bytes()].concat()).unwrap();
    cycles(&mut server, &mut client, 7);
    assert_eq!(server.controller().registers().input.ints[24], 0);
    cycles(&mut server, &mut client, 3);
    assert_eq!(server.controller().registers().input.ints[24], 7);
}

#[test]
fn a_client_that_never_reads_is_dropped_after_ten_seconds_and_holds_nobody_up() {
    let mut server = server();
    let mut idle = connect(&mut server, Port::Rtde);
    // All joints, poses and forces: fills the socket's buffers in good time.
    let names =
        ["actual_q", "target_q", "actual_TCP_pose", "actual_TCP_force"].repeat(40).join(",");
    let size = (3 + 8 + names.len()) as u16;
    let setup = [&size.to_be_bytes()[..], b"O", &500f64.to_be_bytes(), names.as_bytes()].concat();
    idle.write_all(&[b"\0\x05V\0\x02", &setup[..], b"\0\x03S"].concat()).unwrap();
    let mut client = streaming(&mut server);
    let mut cycles_run = 0u32;
    while server.connections(Port::Rtde) == 2 && cycles_run < 30_000 {
        server.tick();
        cycles_run += 1;
        assert_eq!(stamps(&received(&mut client).0).len(), 1, "the other client misses nothing");
    }
    assert!((5_000..20_000).contains(&cycles_run), "dropped after {cycles_run} cycles");
}

#[test]
fn a_storm_of_connections_leaves_the_controller_as_it_was() {
    let mut server = server();
    let mut client = streaming(&mut server);
    for round in 0..50 {
        let sockets: Vec<_> = (0..10)
            .map(|n| {
                let port = Port::ALL[n % 5];
                let mut socket = TcpStream::connect(server.address(port).unwrap()).unwrap();
                socket.write_all(&[round as u8; 17][..n]).unwrap();
                socket
            })
            .collect();
        server.tick();
        drop(sockets);
    }
    for _ in 0..200 {
        server.tick();
    }
    assert_eq!(Port::ALL.map(|p| server.connections(p)), [1, 0, 0, 0, 0]);
    received(&mut client);
    assert_eq!(stamps(&cycles(&mut server, &mut client, 10).concat()).len(), 10);
    assert_eq!(server.controller().safety(), SafetyStatus::Normal);
}
