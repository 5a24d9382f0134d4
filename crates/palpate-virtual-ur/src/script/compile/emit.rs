//! Statements and expressions of one function to its instructions.

use std::collections::HashMap;

use super::{Code, Head, Op, assigned, remember};
use crate::script::ast::{Call, Expression, Function, FunctionKind, Line, Node, Scope, Statement};
use crate::script::builtin::{Builtin, NOT_MODELLED};
use crate::script::error::{ErrorKind, ScriptError};
use crate::script::ops;
use crate::script::value::Value;

pub(super) struct Loop {
    start: usize,
    /// Jumps to be pointed past the loop.
    breaks: Vec<usize>,
}

pub(super) struct Compiler<'a> {
    pub(super) indices: &'a HashMap<&'a str, usize>,
    pub(super) heads: &'a [Head],
    pub(super) globals: &'a [String],
    pub(super) code: &'a mut Code,
    pub(super) loops: Vec<Loop>,
    pub(super) is_main: bool,
}

enum Place {
    Global(usize),
    Local(usize),
}

impl Compiler<'_> {
    pub(super) fn function(&mut self, function: &Function) -> Result<(), ScriptError> {
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
