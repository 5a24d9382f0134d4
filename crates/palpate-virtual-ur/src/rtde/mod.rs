//! The server's side of RTDE: which variables exist, and one connection's conversation.

mod inputs;
mod outputs;
mod session;

pub use inputs::Input;
pub use outputs::{OUTPUT_NAMES, Output};
pub use session::{ServerSession, SessionFault};

/// Whether a client can write a variable of this name.
pub(crate) fn is_input(name: &str) -> bool {
    Input::named(name).is_some()
}

/// The number in `prefix<number>` where it is below `count`, without leading zeros.
fn numbered(name: &str, prefix: &str, count: usize) -> Option<usize> {
    let digits = name.strip_prefix(prefix)?;
    let number = digits.parse().ok()?;
    (number < count && digits == format!("{number}")).then_some(number)
}
