//! Statements to code for a stack machine.

mod emit;

use std::collections::HashMap;

use crate::script::ast::{
    Binary, Expression, Function, FunctionKind, Line, Node, Scope, Statement, Unary,
};
use crate::script::builtin::{Builtin, NOT_MODELLED};
use crate::script::error::{ErrorKind, ScriptError};
use crate::script::ops;
use crate::script::parser::parse;
use crate::script::value::Value;

/// One instruction; jumps go to an index in the function's code.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Op {
    Constant(Value),
    Global(usize),
    Local(usize),
    SetGlobal(usize),
    SetLocal(usize),
    /// Takes a value and below it this many indices.
    SetGlobalElement(usize, usize),
    SetLocalElement(usize, usize),
    Element,
    List(usize),
    Pose,
    Unary(Unary),
    Binary(Binary),
    Jump(usize),
    /// Takes a boolean.
    JumpUnless(usize),
    /// Leaves the boolean that decides; takes one that does not.
    JumpIfDecided {
        target: usize,
        when: bool,
    },
    Call(usize),
    Builtin(&'static Builtin),
    NotModelled(&'static str),
    Run(usize),
    Kill,
    Join,
    Pop,
    Return,
    Halt,
    EnterCritical,
    ExitCritical,
}

/// A compiled function or thread.
#[derive(Clone, Debug)]
pub(crate) struct Code {
    pub(crate) name: String,
    pub(crate) kind: FunctionKind,
    pub(crate) parameters: Vec<(String, Option<Value>)>,
    /// Names of the local variables, parameters first.
    pub(crate) locals: Vec<String>,
    pub(crate) ops: Vec<Op>,
    /// The line of each instruction.
    pub(crate) lines: Vec<u32>,
}

/// A compiled program, ready for a [`Machine`](super::Machine).
#[derive(Clone, Debug)]
pub struct Program {
    /// The first is the program itself.
    pub(crate) functions: Vec<Code>,
    pub(crate) globals: Vec<String>,
}

impl Program {
    /// The outermost function's name; empty for a single line.
    pub fn name(&self) -> &str {
        &self.functions[0].name
    }

    /// Whether it runs beside the program, without moving the arm.
    pub fn is_secondary(&self) -> bool {
        self.functions[0].kind == FunctionKind::Secondary
    }
}

/// Compiles one program: `def … end`, `sec … end`, or lines of statements.
///
/// # Errors
/// The first thing that is no URScript, with its line.
pub fn compile(text: &str) -> Result<Program, ScriptError> {
    let mut lines = parse(text)?;
    let main = match (lines.pop(), lines.is_empty()) {
        (Some(Line { statement: Statement::Function(main), line }), true) => {
            if main.kind == FunctionKind::Thread || !main.parameters.is_empty() {
                let found = "a thread, or a function with parameters".to_owned();
                return Err(ErrorKind::Syntax { expected: "def program():", found }.at(line));
            }
            main
        }
        (last, _) => Function {
            kind: FunctionKind::Function,
            name: String::new(),
            parameters: Vec::new(),
            body: lines.into_iter().chain(last).collect(),
            line: 1,
        },
    };
    let mut functions = vec![&main];
    nested(&main.body, &mut functions);
    let mut indices = HashMap::new();
    for (index, function) in functions.iter().enumerate() {
        let taken =
            Builtin::named(&function.name).is_some() || NOT_MODELLED.contains(&&*function.name);
        if taken || indices.insert(function.name.as_str(), index).is_some() {
            return Err(ErrorKind::Redefined(function.name.clone()).at(function.line));
        }
    }
    let mut globals = Vec::new();
    assigned(&main.body, &mut |name, _| remember(&mut globals, name));
    for function in &functions {
        assigned(&function.body, &mut |name, scope| {
            if scope == Scope::Global {
                remember(&mut globals, name);
            }
        });
    }
    let mut codes = Vec::new();
    for function in &functions {
        codes.push(signature(function)?);
    }
    let heads: Vec<Head> = codes.iter().map(|c| (c.kind, c.parameters.clone())).collect();
    for (index, function) in functions.iter().enumerate() {
        let mut compiler = emit::Compiler {
            indices: &indices,
            heads: &heads,
            globals: &globals,
            code: &mut codes[index],
            loops: Vec::new(),
            is_main: index == 0,
        };
        compiler.function(function)?;
    }
    Ok(Program { functions: codes, globals })
}

type Head = (FunctionKind, Vec<(String, Option<Value>)>);

fn remember(names: &mut Vec<String>, name: &str) {
    if !names.iter().any(|n| n == name) {
        names.push(name.to_owned());
    }
}

/// Functions inside `lines`, at any depth.
fn nested<'a>(lines: &'a [Line], found: &mut Vec<&'a Function>) {
    for line in lines {
        match &line.statement {
            Statement::Function(function) => {
                found.push(function);
                nested(&function.body, found);
            }
            Statement::If { arms, otherwise } => {
                for (_, body) in arms {
                    nested(body, found);
                }
                nested(otherwise, found);
            }
            Statement::While { body, .. } => nested(body, found),
            _ => {}
        }
    }
}

/// Names assigned in `lines`, not inside nested functions.
fn assigned(lines: &[Line], found: &mut dyn FnMut(&str, Scope)) {
    for line in lines {
        match &line.statement {
            Statement::Assign { scope, name, .. } => found(name, *scope),
            Statement::If { arms, otherwise } => {
                for (_, body) in arms {
                    assigned(body, found);
                }
                assigned(otherwise, found);
            }
            Statement::While { body, .. } => assigned(body, found),
            _ => {}
        }
    }
}

/// The function without its code.
fn signature(function: &Function) -> Result<Code, ScriptError> {
    let mut parameters = Vec::new();
    for (name, default) in &function.parameters {
        let default = default.as_ref().map(constant).transpose()?;
        parameters.push((name.clone(), default));
    }
    if function.kind == FunctionKind::Thread && !parameters.is_empty() {
        let what = "a thread, which takes no parameters";
        return Err(ErrorKind::WrongKind { name: function.name.clone(), what }.at(function.line));
    }
    Ok(Code {
        name: function.name.clone(),
        kind: function.kind,
        locals: parameters.iter().map(|(name, _)| name.clone()).collect(),
        parameters,
        ops: Vec::new(),
        lines: Vec::new(),
    })
}

/// The value of a default argument.
fn constant(node: &Node) -> Result<Value, ScriptError> {
    match &node.expression {
        Expression::Constant(value) => Ok(value.clone()),
        Expression::Unary(operator, operand) => {
            ops::unary(*operator, &constant(operand)?).map_err(|kind| kind.at(node.line))
        }
        Expression::List(items) => {
            items.iter().map(constant).collect::<Result<_, _>>().map(Value::List)
        }
        _ => Err(ErrorKind::Syntax { expected: "a constant", found: "an expression".into() }
            .at(node.line)),
    }
}
