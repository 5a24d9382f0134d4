//! RTDE, UR's real-time data exchange, without any I/O: bytes in, packets out, and back.
//!
//! Nothing here opens a socket, reads a clock or starts a thread; a client and a server can be built on
//! it with any I/O, and tests run without a network.
//!
//! # How to use it
//!
//! | to … | use |
//! |---|---|
//! | cut a TCP stream into packets | [`Framer`]: read into [`space`](Framer::space), say [`filled`](Framer::filled), take [`next_frame`](Framer::next_frame) until `None` |
//! | read what a controller sent | [`ServerPacket::decode`] |
//! | read what a client sent | [`ClientPacket::decode`] |
//! | write either | `encode`, which appends to a `Vec<u8>` (no allocation while its capacity lasts) |
//! | know which value is where in a data packet | [`Recipe`] (client: [`Recipe::granted`]; server: [`Recipe::new`]) and [`Value`] |
//! | run the client's side of a connection | [`Session`] |
//! | name modes and states | [`RobotMode`], [`SafetyStatus`], [`RuntimeState`] |
//!
//! A server answers a setup with one [`VariableReply`] per name (`Type`, `NotFound`, `InUse`) and recipe
//! id 0 if any is not a type; otherwise with the id that its data packets carry (version 2) or that the
//! client's will carry. It starts in [`Version::V1`] and changes to [`Version::V2`] after it has
//! accepted `RequestVersion(2)`.
//!
//! ```
//! use palpate_ur::proto::{ClientPacket, DataType, Framer, Recipe, ServerPacket, Value, VariableReply, Version};
//!
//! // A client asks for one output …
//! let mut wire = Vec::new();
//! let ask = ClientPacket::SetupOutputs { frequency: 500.0, names: vec!["timestamp".into()] };
//! ask.encode(Version::V2, &mut wire)?;
//!
//! // … a server reads it, answers, and sends a value.
//! let mut framer = Framer::new();
//! framer.push(&wire);
//! let asked = ClientPacket::decode(Version::V2, framer.next_frame()?.expect("whole"))?;
//! assert_eq!(asked, ask);
//! let recipe = Recipe::new(1, [("timestamp", DataType::Double)]);
//! let (mut values, mut wire) = (Vec::new(), Vec::new());
//! Value::Double(12.5).write(&mut values);
//! ServerPacket::OutputRecipe { recipe: 1, types: vec![VariableReply::Type(DataType::Double)] }
//!     .encode(Version::V2, &mut wire)?;
//! ServerPacket::Data { recipe: recipe.id(), values: &values }.encode(Version::V2, &mut wire)?;
//! assert_eq!(wire[..10], [0, 10, b'O', 1, b'D', b'O', b'U', b'B', b'L', b'E']);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Robustness
//!
//! Sizes 0 to 65,535 with any kind and any content give a packet, a wait for more bytes or a typed
//! error; never a panic, a hang or a read past the packet's end. A packet that is longer or shorter
//! than its layout is an error: RTDE has no checksum, so a length that does not fit is the only sign of
//! a broken stream.
//!
//! # Source
//!
//! Universal Robots, "Real-Time Data Exchange (RTDE) Guide": all numbers big-endian, no padding.

mod event;
mod frame;
mod message;
mod mode;
mod packet;
mod recipe;
mod session;
mod value;
mod wire;

pub use event::{Event, SessionError, Setup};
pub use frame::{Frame, FrameError, Framer, HEADER, Kind, MAX_PACKET};
pub use message::{ControllerVersion, DecodeError, EncodeError, Level, Text, Version};
pub use mode::{RobotMode, RuntimeState, SafetyStatus};
pub use packet::{ClientPacket, ServerPacket};
pub use recipe::{Field, Recipe, RecipeError, Record};
pub use session::Session;
pub use value::{DataType, Value, VariableReply};
