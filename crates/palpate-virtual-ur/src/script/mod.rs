//! A small URScript interpreter: text in, one control tick at a time out.
//!
//! [`compile`] turns one program (`def … end`, `sec … end` or a single line) into a [`Program`]; a
//! [`Machine`] runs it against a [`World`], the arm and registers that its built-ins act on. The machine
//! has no clock: [`Machine::tick`] is one 2 ms control cycle, in which every thread runs until it
//! calls something that takes time. It is deterministic, and the work of a tick is bounded.
//!
//! ```
//! use palpate_virtual_ur::script::{Machine, Status, compile, testing::Recorder};
//!
//! let program = compile("def count():\n  n = 0\n  while n < 3:\n    n = n + 1\n    sync()\n  end\n  textmsg(\"n=\", n)\nend\n")?;
//! let mut machine = Machine::new(program);
//! let mut world = Recorder::default();
//! let mut ticks = 1;
//! while machine.tick(&mut world)? == Status::Running {
//!     ticks += 1;
//! }
//! assert_eq!((ticks, world.messages[0].as_str()), (4, "n=3"));
//! # Ok::<(), palpate_virtual_ur::script::ScriptError>(())
//! ```
//!
//! # Language
//!
//! Functions, threads, `if`/`elif`/`else`, `while`; numbers, booleans, strings, lists, poses
//! `p[…]`; named and default arguments; `run`, `join`, `kill`, `enter_critical`, `exit_critical`, `halt`.
//! Names follow the script manual's scope rules: what is assigned in the outermost function, or declared
//! `global`, is global; `local` hides it; other names are local to their function. Where the manual leaves a
//! case open the interpreter is strict: integer overflow, a number where a boolean is wanted or a variable
//! read before it is written is an error that names the line.
//!
//! # References
//! Universal Robots, *The URScript Programming Language*, e-Series.

mod ast;
mod builtin;
mod compile;
mod error;
mod exec;
mod expression;
mod lexer;
mod machine;
mod ops;
mod parser;
mod poses;
mod pure;
pub mod testing;
mod unit;
mod value;

pub use builtin::Builtin;
pub use compile::{Program, compile};
pub use error::{ErrorKind, ScriptError};
pub use machine::{Machine, Reply, Status, World};
pub use poses::{pose_to_value, value_to_pose};
pub use unit::{Unit, Units};
pub use value::Value;
