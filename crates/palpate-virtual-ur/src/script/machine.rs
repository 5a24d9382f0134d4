//! Threads of a program, one control cycle at a time.

use super::builtin::{Builtin, Role};
use super::compile::Program;
use super::error::{ErrorKind, ScriptError};
use super::exec::{Slice, Thread, Wait};
use super::value::Value;

/// The controller that a program's built-ins ask and move.
pub trait World {
    /// Carries out `builtin` with one argument per parameter; [`Value::None`] where one was left out.
    ///
    /// # Errors
    /// Why not, in words; it stops the program.
    fn call(&mut self, builtin: &Builtin, arguments: &[Value]) -> Result<Reply, String>;

    /// Whether a motion that a thread waits for is still under way.
    fn is_moving(&self) -> bool;

    /// The thread that moved the arm has ended or was killed.
    fn abandon_motion(&mut self);
}

/// What a built-in answers.
#[derive(Clone, Debug, PartialEq)]
pub enum Reply {
    /// Go on with this value in the same cycle.
    Value(Value),
    /// Go on after this many cycles.
    Ticks(u32),
    /// Go on in the first cycle in which [`World::is_moving`] says no.
    Motion,
}

/// What a tick left behind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The program goes on in the next cycle.
    Running,
    /// It came to its end or to `halt`.
    Finished,
}

/// A program being run.
#[derive(Debug)]
pub struct Machine {
    pub(crate) program: Program,
    pub(crate) globals: Vec<Value>,
    pub(crate) threads: Vec<Thread>,
    pub(crate) tick: u64,
    next_id: i32,
    /// The thread in its critical section.
    pub(crate) critical: Option<i32>,
    /// The thread that moved the arm last, and when.
    mover: Option<(i32, u64)>,
    /// Instructions left in this tick.
    pub(crate) budget: u32,
}

impl Machine {
    /// Instructions of all threads in one tick. A control program of several hundred lines needs 2,000.
    pub const STEPS_PER_TICK: u32 = 20_000;
    /// Threads at a time.
    pub const THREADS_MAX: usize = 50;
    /// Calls inside calls.
    pub const CALLS_MAX: usize = 200;

    /// A program that has not begun.
    pub fn new(program: Program) -> Self {
        let globals = vec![Value::None; program.globals.len()];
        let main = Thread::new(0, 0, &program);
        Self {
            program,
            globals,
            threads: vec![main],
            tick: 0,
            next_id: 1,
            critical: None,
            mover: None,
            budget: 0,
        }
    }

    /// The line that the main thread is at.
    pub fn line(&self) -> u32 {
        self.threads.first().map_or(0, |main| main.line(&self.program))
    }

    /// The program's name.
    pub fn name(&self) -> &str {
        self.program.name()
    }

    /// A global variable's value, for tests and displays.
    pub fn global(&self, name: &str) -> Option<&Value> {
        let slot = self.program.globals.iter().position(|g| g == name)?;
        self.globals.get(slot)
    }

    /// One control cycle: every thread in the order of its creation, until it waits.
    ///
    /// # Errors
    /// The first error of any thread; the program is over.
    pub fn tick<W: World + ?Sized>(&mut self, world: &mut W) -> Result<Status, ScriptError> {
        self.tick += 1;
        self.budget = Self::STEPS_PER_TICK;
        let mut index = 0;
        while index < self.threads.len() {
            let id = self.threads[index].id;
            if self.critical.is_none_or(|holder| holder == id) {
                match self.run(index, world)? {
                    Slice::Halt => return Ok(Status::Finished),
                    Slice::Ended if id == 0 => return Ok(Status::Finished),
                    Slice::Ended => self.retire(id, world),
                    Slice::Waiting => {}
                }
            }
            index += 1;
        }
        self.threads.retain(|t| t.wait != Wait::Ended);
        Ok(Status::Running)
    }

    pub(crate) fn is_alive(&self, id: i32) -> bool {
        self.threads.iter().any(|t| t.id == id && t.wait != Wait::Ended)
    }

    /// Starts a thread; it has its first slice in this very tick.
    pub(crate) fn start(&mut self, function: usize) -> Result<i32, ErrorKind> {
        let alive = self.threads.iter().filter(|t| t.wait != Wait::Ended).count();
        if alive >= Self::THREADS_MAX || self.next_id == i32::MAX {
            return Err(ErrorKind::Threads(Self::THREADS_MAX));
        }
        let id = self.next_id;
        self.next_id += 1;
        self.threads.push(Thread::new(id, function, &self.program));
        Ok(id)
    }

    /// Ends a thread, and its motion with it.
    pub(crate) fn retire<W: World + ?Sized>(&mut self, id: i32, world: &mut W) {
        let Some(thread) = self.threads.iter_mut().find(|t| t.id == id) else { return };
        thread.wait = Wait::Ended;
        if self.critical == Some(id) {
            self.critical = None;
        }
        if self.mover.is_some_and(|(mover, _)| mover == id) {
            self.mover = None;
            world.abandon_motion();
        }
    }

    /// Calls a built-in that needs the controller.
    pub(crate) fn call<W: World + ?Sized>(
        &mut self,
        id: i32,
        builtin: &'static Builtin,
        arguments: &[Value],
        world: &mut W,
    ) -> Result<Reply, ErrorKind> {
        let function = builtin.name;
        let refuse = |problem: &str| Err(ErrorKind::Builtin { function, problem: problem.into() });
        let secondary = self.program.is_secondary();
        if builtin.role == Role::Motion {
            if secondary {
                return refuse("a secondary program cannot move the arm");
            }
            let busy =
                self.mover.filter(|(mover, _)| *mover != id).is_some_and(|(mover, since)| {
                    let waits =
                        self.threads.iter().any(|t| t.id == mover && t.wait == Wait::Motion);
                    since == self.tick || waits
                });
            if busy {
                return Err(ErrorKind::MotionConflict);
            }
            self.mover = Some((id, self.tick));
        }
        match world.call(builtin, arguments) {
            Ok(Reply::Ticks(1..)) if secondary => refuse("a secondary program cannot take time"),
            Ok(reply) => Ok(reply),
            Err(problem) => Err(ErrorKind::Builtin { function, problem }),
        }
    }
}
