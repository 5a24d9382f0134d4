//! Properties of the protocol core, against packets written out by hand and arbitrary ones.

use palpate_ur::proto::*;
use proptest::prelude::*;

/// The byte examples of the protocol's documentation.
#[test]
fn packets_are_the_bytes_of_the_guide() {
    let client = |packet: ClientPacket<'_>| {
        let mut out = Vec::new();
        packet.encode(Version::V2, &mut out).unwrap();
        out
    };
    let server = |packet: ServerPacket<'_>| {
        let mut out = Vec::new();
        packet.encode(Version::V2, &mut out).unwrap();
        out
    };
    let hex = |text: &str| -> Vec<u8> {
        let digits: Vec<u8> =
            text.chars().filter_map(|c| c.to_digit(16)).map(|d| d as u8).collect();
        digits.chunks(2).map(|pair| pair[0] << 4 | pair[1]).collect()
    };
    assert_eq!(client(ClientPacket::RequestVersion(2)), hex("0005 56 0002"));
    assert_eq!(client(ClientPacket::ControllerVersion), hex("0003 76"));
    assert_eq!(
        client(ClientPacket::SetupOutputs { frequency: 500.0, names: vec!["timestamp".into()] }),
        hex("0014 4f 407f400000000000 74696d657374616d70")
    );
    assert_eq!(client(ClientPacket::Start), hex("0003 53"));
    assert_eq!(client(ClientPacket::Pause), hex("0003 50"));
    assert_eq!(server(ServerPacket::VersionAccepted(true)), hex("0004 56 01"));
    let version = ControllerVersion { major: 5, minor: 17, bugfix: 2, build: 0x0102_0304 };
    assert_eq!(
        server(ServerPacket::ControllerVersion(version)),
        hex("0013 76 00000005 00000011 00000002 01020304")
    );
    let double = VariableReply::Type(DataType::Double);
    assert_eq!(
        server(ServerPacket::OutputRecipe { recipe: 1, types: vec![double] }),
        hex("000a 4f 01 444f55424c45")
    );
    assert_eq!(server(ServerPacket::Started(true)), hex("0004 53 01"));
    assert_eq!(server(ServerPacket::Paused(true)), hex("0004 50 01"));
    let text = Text { message: "hi".into(), source: "me".into(), level: Level::Warning };
    assert_eq!(server(ServerPacket::Text(text)), hex("000a 4d 02 6869 02 6d65 02"));
}

fn version() -> impl Strategy<Value = Version> {
    prop_oneof![Just(Version::V1), Just(Version::V2)]
}

fn name() -> impl Strategy<Value = std::borrow::Cow<'static, str>> {
    "[a-z_0-9]{1,30}".prop_map(std::borrow::Cow::Owned)
}

fn text(version: Version, from_server: bool) -> impl Strategy<Value = Text<'static>> {
    let bare = from_server && version == Version::V1;
    let source = if bare { "".boxed() } else { "\\PC{0,60}".boxed() };
    ("\\PC{0,60}", source, any::<u8>()).prop_map(|(message, source, level)| Text {
        message: message.into(),
        source: source.into(),
        level: level.into(),
    })
}

fn client_packet(version: Version) -> impl Strategy<Value = ClientPacket<'static>> {
    let values = proptest::collection::vec(any::<u8>(), 0..300);
    let names = || proptest::collection::vec(name(), 0..40);
    let frequency = if version == Version::V1 {
        Just(None).boxed()
    } else {
        (1.0..500.0f64).prop_map(Some).boxed()
    };
    prop_oneof![
        any::<u16>().prop_map(ClientPacket::RequestVersion),
        Just(ClientPacket::ControllerVersion),
        text(version, false).prop_map(ClientPacket::Text),
        (any::<u8>(), values)
            .prop_map(|(recipe, v)| ClientPacket::Data { recipe, values: v.leak() }),
        (frequency, names()).prop_map(|(f, names)| ClientPacket::SetupOutputs {
            frequency: f.unwrap_or(f64::NAN),
            names
        }),
        names().prop_map(|names| ClientPacket::SetupInputs { names }),
        Just(ClientPacket::Start),
        Just(ClientPacket::Pause),
    ]
}

fn reply() -> impl Strategy<Value = VariableReply> {
    prop_oneof![
        proptest::sample::select(&DataType::ALL[..]).prop_map(VariableReply::Type),
        Just(VariableReply::NotFound),
        Just(VariableReply::InUse),
    ]
}

fn server_packet(version: Version) -> impl Strategy<Value = ServerPacket<'static>> {
    let values = proptest::collection::vec(any::<u8>(), 0..300);
    let types = || proptest::collection::vec(reply(), 0..40);
    let (v1_data, v1_outputs) =
        if version == Version::V1 { (Some(0), Some(1)) } else { (None, None) };
    prop_oneof![
        any::<bool>().prop_map(ServerPacket::VersionAccepted),
        any::<[u32; 4]>().prop_map(|[major, minor, bugfix, build]| {
            ServerPacket::ControllerVersion(ControllerVersion { major, minor, bugfix, build })
        }),
        text(version, true).prop_map(ServerPacket::Text),
        (any::<u8>(), values).prop_map(move |(id, v)| ServerPacket::Data {
            recipe: v1_data.unwrap_or(id),
            values: v.leak()
        }),
        (any::<u8>(), types()).prop_map(move |(id, types)| ServerPacket::OutputRecipe {
            recipe: v1_outputs.unwrap_or(id),
            types
        }),
        (any::<u8>(), types())
            .prop_map(|(recipe, types)| ServerPacket::InputRecipe { recipe, types }),
        any::<bool>().prop_map(ServerPacket::Started),
        any::<bool>().prop_map(ServerPacket::Paused),
    ]
}

/// Frames of a stream that arrives in pieces of the given sizes.
fn frames(stream: &[u8], pieces: &[usize]) -> Result<Vec<(Kind, Vec<u8>)>, FrameError> {
    let mut framer = Framer::new();
    let mut seen = Vec::new();
    let mut pieces = pieces.iter().copied().cycle();
    let mut left = stream;
    while !left.is_empty() {
        let n = pieces.next().unwrap_or(1).clamp(1, left.len());
        let taken = framer.push(&left[..n]);
        left = &left[taken..];
        while let Some(frame) = framer.next_frame()? {
            seen.push((frame.kind, frame.payload.to_vec()));
        }
    }
    assert_eq!(framer.pending(), 0);
    Ok(seen)
}

proptest! {
    #[test]
    fn client_packets_survive_the_wire(
        (version, packet) in version().prop_flat_map(|v| (Just(v), client_packet(v)))
    ) {
        let mut wire = Vec::new();
        packet.encode(version, &mut wire).unwrap();
        let mut framer = Framer::new();
        framer.push(&wire);
        let frame = framer.next_frame().unwrap().unwrap();
        let back = ClientPacket::decode(version, frame).unwrap();
        // NaN stands for "not on the wire": compare as text.
        prop_assert_eq!(format!("{packet:?}"), format!("{back:?}"));
    }

    #[test]
    fn server_packets_survive_the_wire(
        (version, packet) in version().prop_flat_map(|v| (Just(v), server_packet(v)))
    ) {
        let mut wire = Vec::new();
        packet.encode(version, &mut wire).unwrap();
        let mut framer = Framer::new();
        framer.push(&wire);
        let frame = framer.next_frame().unwrap().unwrap();
        prop_assert_eq!(ServerPacket::decode(version, frame).unwrap(), packet);
    }

    #[test]
    fn splits_and_merges_change_nothing(
        packets in proptest::collection::vec(server_packet(Version::V2), 1..60),
        pieces in proptest::collection::vec(1usize..900, 1..40),
    ) {
        let mut stream = Vec::new();
        for packet in &packets {
            packet.encode(Version::V2, &mut stream).unwrap();
        }
        let whole = frames(&stream, &[usize::MAX])?;
        prop_assert_eq!(whole.len(), packets.len());
        prop_assert_eq!(frames(&stream, &pieces)?, whole.clone());
        prop_assert_eq!(frames(&stream, &[1])?, whole);
    }

    #[test]
    fn values_survive_the_wire(types in proptest::collection::vec(
        proptest::sample::select(&DataType::ALL[..]), 0..60), bytes in proptest::collection::vec(any::<u8>(), 60 * 48)
    ) {
        let names: Vec<String> = (0..types.len()).map(|n| format!("v{n}")).collect();
        let recipe = Recipe::new(7, names.iter().map(String::as_str).zip(types.iter().copied()));
        let values: Vec<Value> = recipe.values(&bytes[..recipe.size()]).unwrap().collect();
        let mut wire = Vec::new();
        for value in &values {
            value.write(&mut wire);
        }
        prop_assert_eq!(wire.len(), recipe.size());
        // Booleans are normalised, everything else is bit for bit what it was.
        let again: Vec<Value> = recipe.values(&wire).unwrap().collect();
        prop_assert_eq!(format!("{again:?}"), format!("{values:?}"));
        for (n, (value, kind)) in values.iter().zip(&types).enumerate() {
            let field = &recipe.fields()[n];
            prop_assert_eq!(value.data_type(), *kind);
            if *kind != DataType::Bool {
                let range = field.offset..field.offset + kind.size();
                prop_assert_eq!(&wire[range.clone()], &bytes[range]);
            }
        }
    }

    #[test]
    fn any_payload_of_any_kind_is_a_packet_or_an_error(
        kind in proptest::sample::select(&Kind::ALL[..]),
        payload in proptest::collection::vec(any::<u8>(), 0..200),
        version in version(),
    ) {
        let frame = Frame { kind, payload: &payload };
        let (client, server) = (ClientPacket::decode(version, frame), ServerPacket::decode(version, frame));
        // What is accepted says the same when written again.
        if let Ok(packet) = &server {
            let mut wire = Vec::new();
            if packet.encode(version, &mut wire).is_ok() {
                let again = Frame { kind, payload: &wire[HEADER..] };
                prop_assert_eq!(&ServerPacket::decode(version, again).unwrap(), packet);
            }
        }
        if let Ok(packet) = &client {
            let mut wire = Vec::new();
            if packet.encode(version, &mut wire).is_ok() {
                let again = Frame { kind, payload: &wire[HEADER..] };
                let back = ClientPacket::decode(version, again).unwrap();
                prop_assert_eq!(format!("{back:?}"), format!("{packet:?}"));
            }
        }
    }
}

#[test]
fn a_list_may_end_with_a_comma() {
    for (list, count) in [("a,b,", 2), ("a,b", 2), ("a,,b", 3), ("", 0), (",", 0)] {
        let frame = Frame { kind: Kind::SetupInputs, payload: list.as_bytes() };
        let ClientPacket::SetupInputs { names } = ClientPacket::decode(Version::V2, frame).unwrap()
        else {
            panic!("another kind");
        };
        assert_eq!(names.len(), count, "{list:?}");
    }
}

#[test]
fn what_does_not_fit_a_packet_is_refused_and_leaves_no_bytes() {
    let mut out = vec![9];
    let names = vec!["x".repeat(1000).into(); 70];
    let error = ClientPacket::SetupInputs { names }.encode(Version::V2, &mut out).unwrap_err();
    assert_eq!((error.limit, out.len()), (65_535, 1));
    let text = Text { message: "x".repeat(256).into(), source: "".into(), level: Level::Info };
    let error = ClientPacket::Text(text).encode(Version::V2, &mut out).unwrap_err();
    assert_eq!((error.size, error.limit, out.len()), (256, 255, 1));
}
