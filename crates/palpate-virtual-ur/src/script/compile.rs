//! Statements to code for a stack machine.

use std::collections::HashMap;

use super::ast::Binary;
use super::ast::{Call, Expression, Function, FunctionKind, Line, Node, Scope, Statement, Unary};
use super::builtin::{Builtin, NOT_MODELLED};
use super::error::{ErrorKind, ScriptError};
use super::ops;
use super::parser::parse;
use super::value::Value;

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
        let mut compiler = Compiler {
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

struct Loop {
    start: usize,
    /// Jumps to be pointed past the loop.
    breaks: Vec<usize>,
}

struct Compiler<'a> {
    indices: &'a HashMap<&'a str, usize>,
    heads: &'a [Head],
    globals: &'a [String],
    code: &'a mut Code,
    loops: Vec<Loop>,
    is_main: bool,
}

enum Place {
    Global(usize),
    Local(usize),
}

impl Compiler<'_> {
    fn function(&mut self, function: &Function) -> Result<(), ScriptError> {
        if !self.is_main {
            let (globals, locals) = (self.globals, &mut self.code.locals);
            assigned(&function.body, &mut |name, scope| {
                let free = scope == Scope::Free && !globals.iter().any(|g| g == name);
                if free || scope == Scope::Local {
                    remember(locals, name);
                }
            });
        }
        self.block(&function.body)?;
        let end = self.code.lines.last().copied().unwrap_or(function.line);
        self.emit(Op::Constant(Value::None), end);
        self.emit(Op::Return, end);
        Ok(())
    }

    fn emit(&mut self, op: Op, line: u32) -> usize {
        self.code.ops.push(op);
        self.code.lines.push(line);
        self.code.ops.len() - 1
    }

    /// Points the jump at `index` to the next instruction.
    fn land(&mut self, index: usize) {
        let here = self.code.ops.len();
        if let Some(Op::Jump(target) | Op::JumpUnless(target) | Op::JumpIfDecided { target, .. }) =
            self.code.ops.get_mut(index)
        {
            *target = here;
        }
    }

    fn place(&self, name: &str) -> Option<Place> {
        let local = self.code.locals.iter().position(|l| l == name).map(Place::Local);
        local.or_else(|| self.globals.iter().position(|g| g == name).map(Place::Global))
    }

    fn block(&mut self, lines: &[Line]) -> Result<(), ScriptError> {
        lines.iter().try_for_each(|line| self.statement(&line.statement, line.line))
    }

    fn statement(&mut self, statement: &Statement, line: u32) -> Result<(), ScriptError> {
        match statement {
            Statement::Assign { scope, name, indices, value } => {
                for index in indices {
                    self.expression(index)?;
                }
                self.expression(value)?;
                let explicit = *scope == Scope::Global;
                let global = || self.globals.iter().position(|g| g == name).map(Place::Global);
                let place = if explicit { global() } else { self.place(name) };
                let unset = || ErrorKind::Unset(name.clone()).at(line);
                let op = match (place.ok_or_else(unset)?, indices.len()) {
                    (Place::Global(slot), 0) => Op::SetGlobal(slot),
                    (Place::Local(slot), 0) => Op::SetLocal(slot),
                    (Place::Global(slot), n) => Op::SetGlobalElement(slot, n),
                    (Place::Local(slot), n) => Op::SetLocalElement(slot, n),
                };
                self.emit(op, line);
            }
            Statement::Call(node) => {
                self.expression(node)?;
                self.emit(Op::Pop, line);
            }
            Statement::If { arms, otherwise } => {
                let mut ends = Vec::new();
                for (condition, body) in arms {
                    self.expression(condition)?;
                    let skip = self.emit(Op::JumpUnless(0), condition.line);
                    self.block(body)?;
                    ends.push(self.emit(Op::Jump(0), line));
                    self.land(skip);
                }
                self.block(otherwise)?;
                for end in ends {
                    self.land(end);
                }
            }
            Statement::While { condition, body } => {
                let start = self.code.ops.len();
                self.expression(condition)?;
                let leave = self.emit(Op::JumpUnless(0), condition.line);
                self.loops.push(Loop { start, breaks: vec![leave] });
                self.block(body)?;
                self.emit(Op::Jump(start), line);
                let breaks = self.loops.pop().map(|l| l.breaks).unwrap_or_default();
                for leave in breaks {
                    self.land(leave);
                }
            }
            Statement::Break => {
                let jump = self.emit(Op::Jump(0), line);
                let inner = self.loops.last_mut();
                inner.ok_or(ErrorKind::OutsideLoop("break").at(line))?.breaks.push(jump);
            }
            Statement::Continue => {
                let inner = self.loops.last();
                let start = inner.ok_or(ErrorKind::OutsideLoop("continue").at(line))?.start;
                self.emit(Op::Jump(start), line);
            }
            Statement::Return(value) => {
                match value {
                    Some(node) => self.expression(node)?,
                    None => _ = self.emit(Op::Constant(Value::None), line),
                }
                self.emit(Op::Return, line);
            }
            Statement::Kill(thread) | Statement::Join(thread) => {
                self.expression(thread)?;
                let kill = matches!(statement, Statement::Kill(_));
                self.emit(if kill { Op::Kill } else { Op::Join }, line);
            }
            Statement::Halt => _ = self.emit(Op::Halt, line),
            Statement::EnterCritical => _ = self.emit(Op::EnterCritical, line),
            Statement::ExitCritical => _ = self.emit(Op::ExitCritical, line),
            // A defined function is code of its own.
            Statement::Function(_) | Statement::Pass => {}
        }
        Ok(())
    }

    fn expression(&mut self, node: &Node) -> Result<(), ScriptError> {
        let line = node.line;
        let op = match &node.expression {
            Expression::Constant(value) => Op::Constant(value.clone()),
            Expression::Variable(name) => match self.place(name) {
                Some(Place::Local(slot)) => Op::Local(slot),
                Some(Place::Global(slot)) => Op::Global(slot),
                None => return Err(ErrorKind::Unset(name.clone()).at(line)),
            },
            Expression::List(items) => {
                if items.len() > ops::LENGTH_MAX {
                    return Err(ErrorKind::TooLarge("a list with over 1024 elements").at(line));
                }
                items.iter().try_for_each(|item| self.expression(item))?;
                Op::List(items.len())
            }
            Expression::Pose(items) => {
                if items.len() != 6 {
                    let found = format!("{} elements", items.len());
                    return Err(ErrorKind::Syntax { expected: "six elements", found }.at(line));
                }
                items.iter().try_for_each(|item| self.expression(item))?;
                Op::Pose
            }
            Expression::Index(list, index) => {
                self.expression(list)?;
                self.expression(index)?;
                Op::Element
            }
            Expression::Unary(operator, operand) => {
                self.expression(operand)?;
                Op::Unary(*operator)
            }
            Expression::Binary(operator, left, right) => {
                self.expression(left)?;
                self.expression(right)?;
                Op::Binary(*operator)
            }
            Expression::And(left, right) => return self.decided(left, right, false, line),
            Expression::Or(left, right) => return self.decided(left, right, true, line),
            Expression::Call(call) => return self.call(call, line),
            Expression::Run(name) => match self.indices.get(name.as_str()) {
                Some(&index) if self.heads[index].0 == FunctionKind::Thread => Op::Run(index),
                Some(_) => {
                    let what = "no thread: only a thread can be run";
                    return Err(ErrorKind::WrongKind { name: name.clone(), what }.at(line));
                }
                None => return Err(ErrorKind::UnknownFunction(name.clone()).at(line)),
            },
        };
        self.emit(op, line);
        Ok(())
    }

    /// `and` and `or`: the right side only where the left does not decide.
    fn decided(
        &mut self,
        left: &Node,
        right: &Node,
        when: bool,
        line: u32,
    ) -> Result<(), ScriptError> {
        self.expression(left)?;
        let jump = self.emit(Op::JumpIfDecided { target: 0, when }, line);
        self.expression(right)?;
        // The right side must be a boolean as well: let the same instruction see it.
        let next = self.code.ops.len() + 1;
        self.emit(Op::JumpIfDecided { target: next, when }, line);
        self.emit(Op::Constant(Value::Bool(!when)), line);
        let last = self.code.ops.len() - 2;
        self.land(jump);
        self.land(last);
        Ok(())
    }

    fn call(&mut self, call: &Call, line: u32) -> Result<(), ScriptError> {
        if let Some(name) = NOT_MODELLED.iter().find(|name| **name == call.function) {
            self.emit(Op::NotModelled(name), line);
            return Ok(());
        }
        if let Some(builtin) = Builtin::named(&call.function) {
            let parameters: Vec<_> = builtin
                .parameters
                .iter()
                .enumerate()
                .map(|(i, name)| (*name, (i >= builtin.required).then_some(Value::None)))
                .collect();
            self.arguments(call, &parameters, line)?;
            self.emit(Op::Builtin(builtin), line);
            return Ok(());
        }
        let unknown = || ErrorKind::UnknownFunction(call.function.clone()).at(line);
        let index = *self.indices.get(call.function.as_str()).ok_or_else(unknown)?;
        let heads = self.heads;
        let (kind, parameters) = &heads[index];
        if *kind != FunctionKind::Function || index == 0 {
            let what = "no function that can be called: start a thread with run";
            return Err(ErrorKind::WrongKind { name: call.function.clone(), what }.at(line));
        }
        let parameters: Vec<_> =
            parameters.iter().map(|(name, default)| (name.as_str(), default.clone())).collect();
        self.arguments(call, &parameters, line)?;
        self.emit(Op::Call(index), line);
        Ok(())
    }

    /// Arguments in the order of the parameters, defaults for those left out.
    fn arguments(
        &mut self,
        call: &Call,
        parameters: &[(&str, Option<Value>)],
        line: u32,
    ) -> Result<(), ScriptError> {
        let refuse = |problem: String| {
            Err(ErrorKind::Arguments { function: call.function.clone(), problem }.at(line))
        };
        let mut given: Vec<Option<&Node>> = vec![None; parameters.len()];
        for (position, (name, node)) in call.arguments.iter().enumerate() {
            let slot = match name {
                None => Some(position).filter(|p| *p < parameters.len()),
                Some(name) => parameters.iter().position(|(p, _)| p == name),
            };
            let Some(slot) = slot else {
                return refuse(match name {
                    None => format!("takes {} arguments at most", parameters.len()),
                    Some(name) => format!("has no parameter {name}"),
                });
            };
            if given[slot].replace(node).is_some() {
                return refuse(format!("{} is given twice", parameters[slot].0));
            }
        }
        for (node, (name, default)) in given.into_iter().zip(parameters) {
            match (node, default) {
                (Some(node), _) => self.expression(node)?,
                (None, Some(default)) => _ = self.emit(Op::Constant(default.clone()), line),
                (None, None) => return refuse(format!("{name} is missing")),
            }
        }
        Ok(())
    }
}
