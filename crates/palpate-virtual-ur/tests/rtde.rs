//! RTDE, the server's side, byte for byte: handshake, recipes, ownership, data.

#![expect(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use palpate_kinematics::UrModel;
use palpate_ur::proto::{
    ClientPacket, DataType, Framer, Recipe, ServerPacket, Value, VariableReply, Version,
};
use palpate_virtual_ur::rtde::{OUTPUT_NAMES, Output, ServerSession};
use palpate_virtual_ur::{Controller, ControllerConfig, LaggedArm};

fn robot() -> Controller {
    let home = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0].into();
    Controller::new(ControllerConfig::new(UrModel::Ur3e), Box::new(LaggedArm::at(home))).unwrap()
}

fn ask(session: &mut ServerSession, robot: &mut Controller, bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    session.receive(bytes, robot, &mut out).unwrap();
    out
}

fn request(
    session: &mut ServerSession,
    robot: &mut Controller,
    packet: &ClientPacket<'_>,
) -> Vec<u8> {
    let mut bytes = Vec::new();
    packet.encode(Version::V2, &mut bytes).unwrap();
    ask(session, robot, &bytes)
}

fn hex(text: &str) -> Vec<u8> {
    let digits: Vec<u8> = text.bytes().filter(|b| !b.is_ascii_whitespace()).collect();
    digits
        .chunks(2)
        .map(|d| u8::from_str_radix(std::str::from_utf8(d).unwrap(), 16).unwrap())
        .collect()
}

/// The setup reply's id and types.
fn setup(out: &[u8]) -> (u8, Vec<VariableReply>) {
    let mut framer = Framer::new();
    framer.push(out);
    match ServerPacket::decode(Version::V2, framer.next_frame().unwrap().unwrap()).unwrap() {
        ServerPacket::OutputRecipe { recipe, types }
        | ServerPacket::InputRecipe { recipe, types } => (recipe, types),
        other => panic!("{other:?}"),
    }
}

fn inputs(
    session: &mut ServerSession,
    robot: &mut Controller,
    names: &[&str],
) -> (u8, Vec<VariableReply>) {
    let names = names.iter().map(|n| (*n).into()).collect();
    setup(&request(session, robot, &ClientPacket::SetupInputs { names }))
}

fn outputs(
    session: &mut ServerSession,
    robot: &mut Controller,
    frequency: f64,
    names: &[&str],
) -> (u8, Vec<VariableReply>) {
    let names = names.iter().map(|n| (*n).into()).collect();
    setup(&request(session, robot, &ClientPacket::SetupOutputs { frequency, names }))
}

/// The bytes that the RTDE guide's layouts give, written by hand.
#[test]
fn a_handshake_byte_for_byte() {
    let (mut robot, mut session) = (robot(), ServerSession::new(1));
    for (asked, answered) in [
        ("0005 56 0003", "0004 56 00"),
        ("0005 56 0002", "0004 56 01"),
        ("0003 76", "0013 76 00000005 00000011 00000000 000f4240"),
        // Start before there is anything to send.
        ("0003 53", "0004 53 00"),
        ("0003 50", "0004 50 01"),
        ("0014 4f 407f400000000000 74696d657374616d70", "000a 4f 01 444f55424c45"),
        ("0003 53", "0004 53 01"),
        ("0003 50", "0004 50 01"),
        ("0003 53", "0004 53 01"),
    ] {
        assert_eq!(ask(&mut session, &mut robot, &hex(asked)), hex(answered), "{asked}");
    }
    robot.tick();
    let mut out = Vec::new();
    assert!(session.data(&robot, &mut out));
    assert_eq!(out[..4], hex("000c 55 01"));
    assert_eq!(out[4..], 0.002f64.to_be_bytes());
}

#[test]
fn requests_in_one_segment_or_byte_by_byte_give_the_same_answers() {
    let conversation =
        hex("0005560002 000376 00144f407f40000000000074696d657374616d70 000353 000350");
    let mut robot = robot();
    let whole = ask(&mut ServerSession::new(1), &mut robot, &conversation);
    let mut session = ServerSession::new(2);
    let mut bytewise = Vec::new();
    for byte in &conversation {
        bytewise.extend(ask(&mut session, &mut robot, &[*byte]));
    }
    assert_eq!(whole, bytewise);
    assert_eq!(whole.len(), 4 + 19 + 10 + 4 + 4);
}

#[test]
fn every_documented_output_can_be_had_alone_and_all_at_once() {
    let mut robot = robot();
    robot.tick();
    let mut names: Vec<String> = OUTPUT_NAMES.iter().map(|(n, ..)| (*n).to_owned()).collect();
    for direction in ["input", "output"] {
        for bank in ["int", "double"] {
            names.extend((0..48).map(|i| format!("{direction}_{bank}_register_{i}")));
        }
        names.extend((64..128).map(|i| format!("{direction}_bit_register_{i}")));
        names.extend(
            ["0_to_31", "32_to_63"].iter().map(|r| format!("{direction}_bit_registers{r}")),
        );
    }
    assert!(names.len() > 380, "{}", names.len());
    for name in &names {
        let output = Output::named(name).unwrap_or_else(|| panic!("{name}"));
        assert_eq!(output.value(&robot).data_type(), output.data_type(), "{name}");
    }
    // Far beyond the 2,048 bytes that the guide mentions.
    let (mut session, all): (_, Vec<&str>) =
        (ServerSession::new(1), names.iter().map(String::as_str).collect());
    request(&mut session, &mut robot, &ClientPacket::RequestVersion(2));
    let (id, types) = outputs(&mut session, &mut robot, 500.0, &all);
    assert_eq!((id, types.len()), (1, names.len()));
    request(&mut session, &mut robot, &ClientPacket::Start);
    let recipe = Recipe::granted(id, &all, &types).unwrap();
    let mut out = Vec::new();
    assert!(session.data(&robot, &mut out));
    assert_eq!(out.len(), 4 + recipe.size());
    for name in [
        "actual_qq",
        "output_int_register_48",
        "output_int_register_07",
        "output_bit_register_3",
        "",
    ] {
        assert!(Output::named(name).is_none(), "{name}");
    }
}

#[test]
fn a_missing_name_refuses_the_recipe_and_names_only_itself() {
    let (mut robot, mut session) = (robot(), ServerSession::new(1));
    request(&mut session, &mut robot, &ClientPacket::RequestVersion(2));
    let (id, types) = outputs(&mut session, &mut robot, 500.0, &["timestamp", "nonsense"]);
    assert_eq!(
        (id, types),
        (0, vec![VariableReply::Type(DataType::Double), VariableReply::NotFound])
    );
    assert_eq!(request(&mut session, &mut robot, &ClientPacket::Start), hex("0004 53 00"));
    for frequency in [0.0, -1.0, 501.0, f64::NAN, f64::INFINITY] {
        assert_eq!(
            outputs(&mut session, &mut robot, frequency, &["timestamp"]).0,
            0,
            "{frequency}"
        );
    }
    // A trailing comma is tolerated.
    let asked = b"\x00\x15O\x40\x7f\x40\0\0\0\0\0timestamp,";
    assert_eq!(ask(&mut session, &mut robot, asked), hex("000a 4f 01 444f55424c45"));
}

#[test]
fn an_input_has_one_owner_until_its_connection_ends() {
    let mut robot = robot();
    let (mut first, mut second) = (ServerSession::new(1), ServerSession::new(2));
    let name = "input_int_register_24";
    assert_eq!(inputs(&mut first, &mut robot, &[name]).0, 1);
    // The owner may list it again, in any number of recipes, up to 255.
    for id in 2..=255 {
        assert_eq!(inputs(&mut first, &mut robot, &[name, "input_double_register_24"]).0, id);
    }
    assert_eq!(inputs(&mut first, &mut robot, &[name]).0, 0, "a 256th recipe");
    let (id, types) = inputs(&mut second, &mut robot, &["input_int_register_25", name]);
    assert_eq!((id, types), (0, vec![VariableReply::Type(DataType::Int32), VariableReply::InUse]));
    // A refused recipe owns nothing.
    let mut third = ServerSession::new(3);
    assert_eq!(inputs(&mut third, &mut robot, &["input_int_register_25"]).0, 1);
    first.close(&mut robot);
    assert_eq!(inputs(&mut second, &mut robot, &[name]).0, 1);
}

#[test]
fn inputs_are_applied_as_one_set_and_stay() {
    let (mut robot, mut session) = (robot(), ServerSession::new(1));
    request(&mut session, &mut robot, &ClientPacket::RequestVersion(2));
    let names = [
        "input_int_register_24",
        "input_double_register_30",
        "input_bit_register_64",
        "input_bit_registers32_to_63",
    ];
    assert_eq!(inputs(&mut session, &mut robot, &names).0, 1);
    assert_eq!(
        inputs(&mut session, &mut robot, &["speed_slider_mask", "speed_slider_fraction"]).0,
        2
    );
    let send = |session: &mut ServerSession, robot: &mut Controller, recipe, values: &[Value]| {
        let mut bytes = Vec::new();
        for value in values {
            value.write(&mut bytes);
        }
        request(session, robot, &ClientPacket::Data { recipe, values: &bytes })
    };
    let set = [Value::Int32(-5), Value::Double(2.5), Value::Bool(true), Value::Uint32(0x8000_0001)];
    assert!(send(&mut session, &mut robot, 1, &set).is_empty(), "data get no answer");
    let bank = &robot.registers().input;
    assert_eq!((bank.ints[24], bank.floats[30], bank.bits[64]), (-5, 2.5, true));
    assert_eq!((bank.bits[32], bank.bits[33], bank.bits[63]), (true, false, true));
    // The slider moves only where its mask says so.
    send(&mut session, &mut robot, 2, &[Value::Uint32(0), Value::Double(0.5)]);
    let slider = |robot: &Controller| Output::named("target_speed_fraction").unwrap().value(robot);
    assert_eq!(slider(&robot), Value::Double(1.0));
    send(&mut session, &mut robot, 2, &[Value::Uint32(1), Value::Double(0.5)]);
    assert_eq!(slider(&robot), Value::Double(0.5));
    // Wrong length or id: nothing changes, one text.
    let before = robot.registers().clone();
    let text = send(&mut session, &mut robot, 1, &set[..2]);
    assert_eq!(text[2], b'M');
    assert!(send(&mut session, &mut robot, 9, &set).is_empty());
    assert_eq!(robot.registers().input, before.input);
}

#[test]
fn data_come_at_the_frequency_asked_for() {
    for (frequency, every) in [(500.0, 1), (250.0, 2), (125.0, 4), (300.0, 1), (10.0, 50)] {
        let (mut robot, mut session) = (robot(), ServerSession::new(1));
        request(&mut session, &mut robot, &ClientPacket::RequestVersion(2));
        assert_eq!(outputs(&mut session, &mut robot, frequency, &["timestamp"]).0, 1);
        request(&mut session, &mut robot, &ClientPacket::Start);
        let mut sent = 0;
        for _ in 0..1000 {
            robot.tick();
            sent += u32::from(session.data(&robot, &mut Vec::new()));
        }
        assert_eq!(sent, 1000 / every, "{frequency} Hz");
    }
}

#[test]
fn version_1_has_no_frequency_and_no_recipe_id() {
    let (mut robot, mut session) = (robot(), ServerSession::new(1));
    session.speak_version_1();
    assert_eq!(ask(&mut session, &mut robot, &hex("0005 56 0002")), hex("0004 56 00"));
    assert_eq!(ask(&mut session, &mut robot, b"\x00\x0cOtimestamp"), b"\x00\x09ODOUBLE");
    assert_eq!(ask(&mut session, &mut robot, &hex("0003 53")), hex("0004 53 01"));
    robot.tick();
    let mut out = Vec::new();
    session.data(&robot, &mut out);
    assert_eq!(out, [&hex("000b 55")[..], &0.002f64.to_be_bytes()].concat());
}

#[test]
fn what_is_not_rtde_ends_the_session_and_nothing_else() {
    let mut robot = robot();
    for bytes in
        [&b"GET / HTTP/1.1\r\n"[..], &[0, 0, 0], &[0, 2, b'V'], &[0, 4, b'V', 0], &[0, 4, b'S', 0]]
    {
        let (mut session, mut out) = (ServerSession::new(1), Vec::new());
        session.receive(bytes, &mut robot, &mut out).unwrap_err();
        assert_eq!(out, [0u8; 0]);
    }
}

mod fuzz {
    use super::{Controller, ServerSession, hex, robot};
    use rand::{Rng, RngCore, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Valid conversations with flipped, lost and added bytes: no panic, no hang, and a bounded answer.
    #[test]
    fn ten_million_mutated_packets() {
        let seeds: Vec<Vec<u8>> = [
            "0005560002",
            "000376",
            "00144f407f40000000000074696d657374616d70",
            "000353",
            "000350",
            "001849696e7075745f696e745f72656769737465725f3234",
            "0008550100000007",
            "000b4d03616263017a0103",
        ]
        .iter()
        .map(|text| hex(text))
        .collect();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut robot: Controller = robot();
        let mut session = ServerSession::new(1);
        let (mut out, mut refused, mut client) = (Vec::new(), 0u32, 1);
        for _ in 0..10_000_000 {
            let mut bytes = seeds[rng.random_range(0..seeds.len())].clone();
            if rng.random_bool(0.3) {
                let at = rng.random_range(0..bytes.len());
                match rng.random_range(0..3) {
                    0 => bytes[at] ^= 1 << rng.random_range(0..8),
                    1 => _ = bytes.remove(at),
                    _ => bytes.insert(at, rng.next_u32() as u8),
                }
            }
            out.clear();
            if session.receive(&bytes, &mut robot, &mut out).is_err() {
                refused += 1;
                client += 1;
                session.close(&mut robot);
                session = ServerSession::new(client);
            }
            assert!(out.len() < 70_000, "{} bytes of answer to {}", out.len(), bytes.len());
        }
        assert!(refused > 100_000, "{refused}");
        robot.tick();
    }
}
