//! What the parser makes of a program.

use super::value::Value;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unary {
    Minus,
    Not,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Remainder,
    Equal,
    NotEqual,
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
    Xor,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Expression {
    Constant(Value),
    Variable(String),
    List(Vec<Node>),
    Pose(Vec<Node>),
    Index(Box<Node>, Box<Node>),
    Unary(Unary, Box<Node>),
    Binary(Binary, Box<Node>, Box<Node>),
    And(Box<Node>, Box<Node>),
    Or(Box<Node>, Box<Node>),
    Call(Call),
    Run(String),
}

/// A call; arguments by name come last.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Call {
    pub(crate) function: String,
    pub(crate) arguments: Vec<(Option<String>, Node)>,
}

/// An expression and its line.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Node {
    pub(crate) expression: Expression,
    pub(crate) line: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scope {
    Free,
    Local,
    Global,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Statement {
    Assign {
        scope: Scope,
        name: String,
        indices: Vec<Node>,
        value: Node,
    },
    Call(Node),
    /// Conditions and their blocks, then the block of `else`.
    If {
        arms: Vec<(Node, Vec<Line>)>,
        otherwise: Vec<Line>,
    },
    While {
        condition: Node,
        body: Vec<Line>,
    },
    Function(Function),
    Return(Option<Node>),
    Break,
    Continue,
    Halt,
    Pass,
    Kill(Node),
    Join(Node),
    EnterCritical,
    ExitCritical,
}

/// A statement and its line.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Line {
    pub(crate) statement: Statement,
    pub(crate) line: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FunctionKind {
    /// `def`.
    Function,
    /// `thread`.
    Thread,
    /// `sec`: runs beside the program without moving the arm.
    Secondary,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Function {
    pub(crate) kind: FunctionKind,
    pub(crate) name: String,
    /// Names and default values.
    pub(crate) parameters: Vec<(String, Option<Node>)>,
    pub(crate) body: Vec<Line>,
    pub(crate) line: u32,
}
