//! One thread's slice of a tick: the instruction loop.

use super::builtin::Role;
use super::compile::{Op, Program};
use super::error::{ErrorKind, ScriptError};
use super::machine::{Machine, Reply, World};
use super::value::Value;
use super::{ops, pure};

/// What a thread waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wait {
    Nothing,
    /// This tick.
    Until(u64),
    Motion,
    /// Another thread's end.
    Join(i32),
    Ended,
}

/// How a slice ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Slice {
    Waiting,
    Ended,
    Halt,
}

#[derive(Clone, Copy, Debug)]
struct Frame {
    function: usize,
    next: usize,
    /// Where the function's variables begin in `locals`.
    base: usize,
}

/// A thread of the program.
#[derive(Debug)]
pub(crate) struct Thread {
    pub(crate) id: i32,
    pub(crate) wait: Wait,
    frames: Vec<Frame>,
    locals: Vec<Value>,
    stack: Vec<Value>,
}

impl Thread {
    pub(crate) fn new(id: i32, function: usize, program: &Program) -> Self {
        let locals = vec![Value::None; program.functions[function].locals.len()];
        let frames = vec![Frame { function, next: 0, base: 0 }];
        Self { id, wait: Wait::Nothing, frames, locals, stack: Vec::new() }
    }

    /// The line it is at.
    pub(crate) fn line(&self, program: &Program) -> u32 {
        let Some(frame) = self.frames.last() else { return 0 };
        let lines = &program.functions[frame.function].lines;
        lines.get(frame.next.saturating_sub(1)).copied().unwrap_or_default()
    }

    fn pop(&mut self) -> Value {
        self.stack.pop().unwrap_or_default()
    }

    fn pop_bool(&mut self) -> Result<bool, ErrorKind> {
        match self.pop() {
            Value::Bool(b) => Ok(b),
            other => Err(ErrorKind::Type { what: "decide by", values: other.kind().into() }),
        }
    }

    /// The top `n` values, the first pushed first.
    fn take(&mut self, n: usize) -> Vec<Value> {
        self.stack.split_off(self.stack.len() - n)
    }
}

impl Machine {
    /// Runs the thread at `index` until it waits or ends.
    pub(crate) fn run<W: World + ?Sized>(
        &mut self,
        index: usize,
        world: &mut W,
    ) -> Result<Slice, ScriptError> {
        let ready = match self.threads[index].wait {
            Wait::Nothing => true,
            Wait::Until(tick) => self.tick >= tick,
            Wait::Motion => !world.is_moving(),
            Wait::Join(other) => !self.is_alive(other),
            Wait::Ended => false,
        };
        if !ready {
            return Ok(Slice::Waiting);
        }
        self.threads[index].wait = Wait::Nothing;
        loop {
            let at = |machine: &Self, kind: ErrorKind| {
                kind.at(machine.threads[index].line(&machine.program))
            };
            if self.budget == 0 {
                return Err(at(self, ErrorKind::Runaway(Self::STEPS_PER_TICK)));
            }
            self.budget -= 1;
            match self.step(index, world) {
                Ok(None) => {}
                Ok(Some(slice)) => return Ok(slice),
                Err(kind) => return Err(at(self, kind)),
            }
        }
    }

    #[expect(clippy::too_many_lines, reason = "one arm per instruction")]
    fn step<W: World + ?Sized>(
        &mut self,
        index: usize,
        world: &mut W,
    ) -> Result<Option<Slice>, ErrorKind> {
        let thread = &mut self.threads[index];
        let Some(frame) = thread.frames.last_mut() else { return Ok(Some(Slice::Ended)) };
        let base = frame.base;
        let code = &self.program.functions[frame.function];
        let Some(op) = code.ops.get(frame.next) else { return Ok(Some(Slice::Ended)) };
        frame.next += 1;
        match op {
            Op::Constant(value) => thread.stack.push(value.clone()),
            Op::Local(slot) => {
                let value = &thread.locals[base + slot];
                if *value == Value::None {
                    return Err(ErrorKind::Unset(code.locals[*slot].clone()));
                }
                let value = value.clone();
                thread.stack.push(value);
            }
            Op::Global(slot) => {
                let value = &self.globals[*slot];
                if *value == Value::None {
                    return Err(ErrorKind::Unset(self.program.globals[*slot].clone()));
                }
                thread.stack.push(value.clone());
            }
            Op::SetLocal(slot) => {
                let value = some(thread.pop())?;
                thread.locals[base + slot] = value;
            }
            Op::SetGlobal(slot) => self.globals[*slot] = some(thread.pop())?,
            Op::SetLocalElement(slot, n) => {
                let value = some(thread.pop())?;
                let indices = thread.take(*n);
                ops::set_element(&mut thread.locals[base + slot], &indices, value)?;
            }
            Op::SetGlobalElement(slot, n) => {
                let value = some(thread.pop())?;
                let indices = thread.take(*n);
                ops::set_element(&mut self.globals[*slot], &indices, value)?;
            }
            Op::Element => {
                let (at, list) = (thread.pop(), thread.pop());
                thread.stack.push(ops::element(&list, &at)?);
            }
            Op::List(n) => {
                let items = thread.take(*n).into_iter().map(some).collect::<Result<_, _>>()?;
                thread.stack.push(Value::List(items));
            }
            Op::Pose => {
                let items = Value::List(thread.take(6));
                let what = "make a pose of";
                let six = items
                    .six()
                    .ok_or_else(|| ErrorKind::Type { what, values: items.to_string() })?;
                thread.stack.push(Value::Pose(six));
            }
            Op::Unary(operator) => {
                let operand = thread.pop();
                thread.stack.push(ops::unary(*operator, &operand)?);
            }
            Op::Binary(operator) => {
                let (right, left) = (thread.pop(), thread.pop());
                thread.stack.push(ops::binary(*operator, &left, &right)?);
            }
            Op::Jump(target) => frame.next = *target,
            Op::JumpUnless(target) => {
                let target = *target;
                if !thread.pop_bool()? {
                    thread.jump(target);
                }
            }
            Op::JumpIfDecided { target, when } => {
                let (target, when) = (*target, *when);
                if thread.pop_bool()? == when {
                    thread.stack.push(Value::Bool(when));
                    thread.jump(target);
                }
            }
            Op::Pop => _ = thread.pop(),
            Op::Call(function) => {
                let function = *function;
                if thread.frames.len() >= Self::CALLS_MAX {
                    return Err(ErrorKind::Recursion(Self::CALLS_MAX));
                }
                let callee = &self.program.functions[function];
                let base = thread.locals.len();
                let arguments = thread.take(callee.parameters.len());
                for argument in arguments {
                    thread.locals.push(some(argument)?);
                }
                thread.locals.resize(base + callee.locals.len(), Value::None);
                thread.frames.push(Frame { function, next: 0, base });
            }
            Op::Return => {
                thread.locals.truncate(base);
                thread.frames.pop();
                if thread.frames.is_empty() {
                    return Ok(Some(Slice::Ended));
                }
            }
            Op::NotModelled(name) => return Err(ErrorKind::NotModelled((*name).to_owned())),
            Op::Halt => return Ok(Some(Slice::Halt)),
            Op::EnterCritical => self.critical = Some(thread.id),
            Op::ExitCritical => self.critical = None,
            Op::Run(function) => {
                let function = *function;
                let id = self.start(function)?;
                self.threads[index].stack.push(Value::Int(id));
            }
            Op::Kill | Op::Join => {
                let kill = *op == Op::Kill;
                let Value::Int(id) = thread.pop() else {
                    return Err(ErrorKind::Type {
                        what: "kill or join",
                        values: "what is no thread".into(),
                    });
                };
                return Ok(if kill { self.kill(index, id, world) } else { self.join(index, id) });
            }
            Op::Builtin(builtin) => {
                let builtin = *builtin;
                let arguments = thread.take(builtin.parameters.len());
                if builtin.role == Role::Pure {
                    thread.stack.push(pure::call(builtin.name, &arguments)?);
                    return Ok(None);
                }
                let id = thread.id;
                let reply = self.call(id, builtin, &arguments, world)?;
                let thread = &mut self.threads[index];
                match reply {
                    Reply::Value(value) => thread.stack.push(value),
                    Reply::Ticks(0) => thread.stack.push(Value::None),
                    Reply::Ticks(ticks) => {
                        thread.stack.push(Value::None);
                        thread.wait = Wait::Until(self.tick + u64::from(ticks));
                        return Ok(Some(Slice::Waiting));
                    }
                    Reply::Motion => {
                        thread.stack.push(Value::None);
                        thread.wait = Wait::Motion;
                        return Ok(Some(Slice::Waiting));
                    }
                }
            }
        }
        Ok(None)
    }

    fn kill<W: World + ?Sized>(&mut self, index: usize, id: i32, world: &mut W) -> Option<Slice> {
        if id != 0 && self.threads[index].id == id {
            return Some(Slice::Ended);
        }
        // Programs give their handles the value 0 before there is a thread; 0 is nobody's.
        if id != 0 {
            self.retire(id, world);
        }
        None
    }

    fn join(&mut self, index: usize, id: i32) -> Option<Slice> {
        if id == 0 || id == self.threads[index].id || !self.is_alive(id) {
            return None;
        }
        self.threads[index].wait = Wait::Join(id);
        Some(Slice::Waiting)
    }
}

impl Thread {
    fn jump(&mut self, target: usize) {
        if let Some(frame) = self.frames.last_mut() {
            frame.next = target;
        }
    }
}

/// A value that can be stored: not that of a function without `return`.
fn some(value: Value) -> Result<Value, ErrorKind> {
    match value {
        Value::None => Err(ErrorKind::Type {
            what: "store",
            values: "the result of a function that returns nothing".into(),
        }),
        value => Ok(value),
    }
}
