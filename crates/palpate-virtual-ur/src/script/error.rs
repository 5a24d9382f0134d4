//! What can be wrong with a script.

/// A script error and the line it is on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {kind}")]
pub struct ScriptError {
    /// Counted from 1.
    pub line: u32,
    /// What is wrong.
    pub kind: ErrorKind,
}

/// What is wrong with a script.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ErrorKind {
    /// A character that begins no word of the language.
    #[error("unexpected character {0:?}")]
    Character(char),
    /// A string without its closing quote.
    #[error("the string is not closed on its line")]
    OpenString,
    /// A number that fits no type.
    #[error("{0} is no number: integers have 32 bits")]
    Number(String),
    /// A word in the wrong place.
    #[error("expected {expected}, found {found}")]
    Syntax {
        /// What could stand here.
        expected: &'static str,
        /// What does.
        found: String,
    },
    /// `break` or `continue` outside `while`.
    #[error("{0} outside a while loop")]
    OutsideLoop(&'static str),
    /// Nested deeper than [`DEPTH_MAX`](crate::script::ErrorKind::DEPTH_MAX).
    #[error("nested deeper than {} levels", Self::DEPTH_MAX)]
    TooDeep,
    /// More constants, variables or code than a program may have.
    #[error("the program is too large: {0}")]
    TooLarge(&'static str),
    /// A name that was defined before.
    #[error("{0} is already the name of a function")]
    Redefined(String),
    /// A call of a name that is neither a function of the script nor a built-in.
    #[error("{0} is no function: define it before, or check the spelling")]
    UnknownFunction(String),
    /// `run` of something that is no thread, or a call of something that is one.
    #[error("{name} is {what}")]
    WrongKind {
        /// The function.
        name: String,
        /// What it is.
        what: &'static str,
    },
    /// A call with arguments that the function does not take.
    #[error("{function}: {problem}")]
    Arguments {
        /// The function called.
        function: String,
        /// What is wrong with its arguments.
        problem: String,
    },
    /// A variable that has no value yet.
    #[error("the variable {0} is used before it has a value")]
    Unset(String),
    /// An operation on values that it does not know.
    #[error("cannot {what} {values}")]
    Type {
        /// The operation.
        what: &'static str,
        /// The types of its values.
        values: String,
    },
    /// An index outside a list.
    #[error("index {index} of a list with {length} elements")]
    Index {
        /// The index.
        index: i32,
        /// The list's length.
        length: usize,
    },
    /// Integer arithmetic that leaves 32 bits, or a division by zero.
    #[error("{0}")]
    Arithmetic(&'static str),
    /// A built-in refused.
    #[error("{function}: {problem}")]
    Builtin {
        /// Its name.
        function: &'static str,
        /// Why.
        problem: String,
    },
    /// A built-in of real controllers that is not modelled.
    #[error("{0} exists on a real controller but is not modelled here")]
    NotModelled(String),
    /// A second thread moved the arm in the same tick.
    #[error("another thread is already controlling the robot: only one may move it in a cycle")]
    MotionConflict,
    /// The work of a tick did not end.
    #[error(
        "infinite loop detected: {0} steps without sync, sleep or motion; put sync() into the loop"
    )]
    Runaway(u32),
    /// Functions that call one another without end.
    #[error("calls nested deeper than {0}")]
    Recursion(usize),
    /// More threads than a program may have.
    #[error("more than {0} threads")]
    Threads(usize),
}

impl ErrorKind {
    /// Blocks and brackets nest this deep at most.
    pub const DEPTH_MAX: usize = 64;

    pub(crate) fn at(self, line: u32) -> ScriptError {
        ScriptError { line, kind: self }
    }
}
