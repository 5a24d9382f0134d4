//! The client's state machine, without a network: a hand-written controller, one packet at a time.
#![expect(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use std::time::Duration;

use palpate_ur::proto::*;

const SECOND: Duration = Duration::from_secs(1);

fn session() -> Session {
    let setup = Setup {
        frequency: 500.0,
        outputs: vec!["timestamp".into(), "robot_mode".into()],
        inputs: vec![vec!["input_int_register_24".into()], vec!["input_double_register_24".into()]],
        timeout: SECOND,
    };
    Session::new(setup, Duration::ZERO).unwrap()
}

/// Delivers a packet; what the session made of it, as text.
fn deliver(session: &mut Session, packet: &ServerPacket<'_>) -> Result<String, SessionError> {
    let mut bytes = Vec::new();
    packet.encode(Version::V2, &mut bytes).unwrap();
    session.space()[..bytes.len()].copy_from_slice(&bytes);
    session.filled(bytes.len());
    Ok(format!("{:?}", session.next_event(Duration::ZERO)?.unwrap()))
}

/// What the session wants sent, as kinds.
fn requests(session: &mut Session) -> Vec<Kind> {
    let mut framer = Framer::new();
    framer.push(session.outgoing());
    let n = session.outgoing().len();
    session.sent(n);
    std::iter::from_fn(|| framer.next_frame().unwrap().map(|frame| frame.kind)).collect()
}

fn typed(types: &[DataType]) -> Vec<VariableReply> {
    types.iter().copied().map(VariableReply::Type).collect()
}

fn outputs() -> ServerPacket<'static> {
    ServerPacket::OutputRecipe { recipe: 1, types: typed(&[DataType::Double, DataType::Int32]) }
}

fn text() -> ServerPacket<'static> {
    let text = Text { message: "SafetySetup".into(), source: "x".into(), level: Level::Info };
    ServerPacket::Text(text)
}

/// Up to the answer to start.
fn set_up() -> Session {
    let mut s = session();
    assert_eq!(requests(&mut s), [Kind::ProtocolVersion]);
    deliver(&mut s, &ServerPacket::VersionAccepted(true)).unwrap();
    assert_eq!(requests(&mut s), [Kind::ControllerVersion]);
    // Texts may come at any time.
    assert!(deliver(&mut s, &text()).unwrap().contains("SafetySetup"));
    assert_eq!(requests(&mut s), []);
    let version = ControllerVersion { major: 5, minor: 9, bugfix: 4, build: 7 };
    deliver(&mut s, &ServerPacket::ControllerVersion(version)).unwrap();
    assert_eq!(s.controller(), version);
    assert_eq!(requests(&mut s), [Kind::SetupOutputs]);
    deliver(&mut s, &outputs()).unwrap();
    for (id, kind) in [(1, DataType::Int32), (2, DataType::Double)] {
        assert_eq!(requests(&mut s), [Kind::SetupInputs]);
        let reply = ServerPacket::InputRecipe { recipe: id, types: typed(&[kind]) };
        deliver(&mut s, &reply).unwrap();
    }
    assert_eq!(requests(&mut s), [Kind::Start]);
    s
}

const DATA: ServerPacket<'static> =
    ServerPacket::Data { recipe: 1, values: &[0x40, 0x7f, 0x40, 0, 0, 0, 0, 0, 0, 0, 0, 7] };

#[test]
fn a_connection_from_the_first_packet_to_the_pause_and_on() {
    let mut s = set_up();
    deliver(&mut s, &ServerPacket::Started(true)).unwrap();
    assert!(s.is_running() && s.deadline().is_none());
    deliver(&mut s, &DATA).unwrap();
    s.pause(Duration::ZERO).unwrap();
    assert_eq!(requests(&mut s), [Kind::Pause]);
    // What was on its way.
    assert_eq!(deliver(&mut s, &DATA).unwrap(), "LateData");
    assert_eq!(deliver(&mut s, &ServerPacket::Paused(true)).unwrap(), "Paused");
    assert!(s.pause(Duration::ZERO).is_err());
    s.resume(Duration::ZERO).unwrap();
    assert_eq!(requests(&mut s), [Kind::Start]);
    deliver(&mut s, &ServerPacket::Started(true)).unwrap();
    assert!(s.is_running());
}

#[test]
fn data_that_overtakes_the_answer_to_start_is_proof_of_it() {
    let mut s = set_up();
    assert!(deliver(&mut s, &DATA).unwrap().starts_with("Data"));
    assert!(s.is_running() && s.deadline().is_none());
    assert_eq!(deliver(&mut s, &ServerPacket::Started(true)).unwrap(), "Started");
    // A second answer was never asked for.
    assert!(deliver(&mut s, &ServerPacket::Started(true)).is_err());
}

#[test]
fn values_are_read_with_the_types_that_the_controller_announced() {
    let mut s = set_up();
    let mut bytes = Vec::new();
    DATA.encode(Version::V2, &mut bytes).unwrap();
    s.space()[..bytes.len()].copy_from_slice(&bytes);
    s.filled(bytes.len());
    let Some(Event::Data(record)) = s.next_event(Duration::ZERO).unwrap() else {
        panic!("no data")
    };
    assert_eq!([record.value(0), record.value(1)], [Value::Double(500.0), Value::Int32(7)]);
}

#[test]
fn an_answer_that_is_overdue_is_named() {
    let mut s = session();
    assert_eq!(s.deadline(), Some(SECOND));
    s.poll(SECOND / 2).unwrap();
    let error = s.poll(SECOND).unwrap_err().to_string();
    assert!(error.contains("the answer to the protocol version within 1s"), "{error}");
    assert_eq!(s.next_event(SECOND).unwrap_err(), SessionError::Failed);
}

#[test]
fn answers_that_do_not_fit_are_errors() {
    let wrong_count = ServerPacket::OutputRecipe { recipe: 1, types: typed(&[DataType::Double]) };
    let refused = ServerPacket::OutputRecipe {
        recipe: 0,
        types: typed(&[DataType::Double, DataType::Int32]),
    };
    for (packet, part) in [
        (wrong_count, "answers 2 variables with 1 types"),
        (refused, "refuses a recipe of 2 variables"),
        (ServerPacket::Paused(true), "an answer to pause while the output recipe was due"),
        (DATA, "data while the output recipe was due"),
    ] {
        let mut s = session();
        deliver(&mut s, &ServerPacket::VersionAccepted(true)).unwrap();
        let version = ControllerVersion::default();
        deliver(&mut s, &ServerPacket::ControllerVersion(version)).unwrap();
        let error = deliver(&mut s, &packet).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
    let mut s = set_up();
    assert_eq!(
        deliver(&mut s, &ServerPacket::Started(false)).unwrap_err(),
        SessionError::StartRefused
    );
}

#[test]
fn inputs_are_typed_and_never_pile_up() {
    let mut s = set_up();
    deliver(&mut s, &ServerPacket::Started(true)).unwrap();
    assert!(s.write(0, &[Value::Double(1.0)]).is_err());
    assert!(s.write(0, &[]).is_err());
    assert!(s.write(2, &[Value::Int32(1)]).is_err());
    assert!(s.write(0, &[Value::Int32(0x0102_0304)]).unwrap());
    assert_eq!(s.outgoing(), [0, 8, b'U', 1, 1, 2, 3, 4]);
    // The network takes five bytes: the rest must go first, a newer value is dropped.
    s.sent(5);
    assert!(!s.write(1, &[Value::Double(1.0)]).unwrap());
    assert_eq!(s.outgoing(), [2, 3, 4]);
    s.sent(3);
    assert!(s.write(1, &[Value::Double(1.0)]).unwrap());
}
