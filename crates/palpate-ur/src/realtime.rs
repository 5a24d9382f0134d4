//! What this computer grants the thread that talks to the arm.

use thread_priority::{
    NormalThreadSchedulePolicy, RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue,
    ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};

/// What was asked for and what was granted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Realtime {
    /// SCHED_FIFO with this priority, or why not.
    pub fifo: Result<u8, String>,
    /// All memory locked, or why not.
    pub locked: Result<(), String>,
}

/// Puts the calling thread under SCHED_FIFO and locks the process's memory as far as permitted.
///
/// Call it on the thread that reads and writes the arm, after everything large is allocated. Without
/// permission nothing changes and the report says so: the arm still works, with later wake-ups. `priority`
/// is 1 to 99; stay below 99, where the kernel's own threads are. Locking covers the memory that there is: what
/// a learner takes later is none of this thread's, and must not be refused to it because of a limit.
pub fn realtime(priority: u8, lock: bool) -> Realtime {
    let fifo =
        ThreadPriorityValue::try_from(priority).map_err(|e| format!("priority {priority}: {e}"));
    let fifo = fifo.and_then(|value| {
        set_thread_priority_and_policy(
            thread_native_id(),
            ThreadPriority::Crossplatform(value),
            ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo),
        )
        .map(|()| priority)
        .map_err(|e| {
            format!("SCHED_FIFO is not permitted ({e}): set rtprio in /etc/security/limits.d, or CAP_SYS_NICE")
        })
    });
    Realtime { fifo, locked: if lock { lock_memory() } else { Err("not asked for".into()) } }
}

/// Locks the memory that the process has by now: after something large was taken for a thread that must not wait for it.
///
/// # Errors
/// Why it is not permitted, and what to do about it.
#[cfg(target_os = "linux")]
pub fn lock_memory() -> Result<(), String> {
    use rustix::mm::{MlockAllFlags, mlockall};
    mlockall(MlockAllFlags::CURRENT).map_err(|e| {
        format!("mlockall is not permitted ({e}): set memlock in /etc/security/limits.d, or CAP_IPC_LOCK")
    })
}

/// Locks the memory that the process has by now.
///
/// # Errors
/// Always: there is no such call here.
#[cfg(not(target_os = "linux"))]
pub fn lock_memory() -> Result<(), String> {
    Err("not on this system".into())
}

impl std::fmt::Display for Realtime {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.fifo {
            Ok(priority) => write!(f, "SCHED_FIFO {priority}")?,
            Err(why) => f.write_str(why)?,
        }
        match &self.locked {
            Ok(()) => f.write_str("; memory locked"),
            Err(why) => write!(f, "; memory not locked: {why}"),
        }
    }
}

/// What was done to a thread that must not disturb the one that talks to the arm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Background {
    /// Niceness 10: behind every other program, too.
    Nice,
    /// SCHED_IDLE: it runs when nothing else wants to.
    Idle,
    /// Nothing, and why.
    Refused(String),
}

/// Puts the calling thread, and those that it starts from now on, behind the one that talks to the arm: niceness 10
/// where that one has SCHED_FIFO and goes first anyway, SCHED_IDLE where it has not. There is no way back.
pub fn background(control: &Realtime) -> Background {
    if control.fifo.is_ok() { nice() } else { idle() }
}

#[cfg(target_os = "linux")]
fn nice() -> Background {
    match rustix::process::setpriority_process(None, 10) {
        Ok(()) => Background::Nice,
        Err(e) => Background::Refused(e.to_string()),
    }
}

#[cfg(target_os = "linux")]
fn idle() -> Background {
    let idle = ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Idle);
    let set = set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Min, idle);
    // Who was nice before cannot be less so, and need not.
    match (thread_priority::thread_schedule_policy(), set) {
        (Ok(policy), _) if policy == idle => Background::Idle,
        (_, Err(e)) => Background::Refused(e.to_string()),
        (_, Ok(())) => Background::Refused("SCHED_IDLE was not taken".into()),
    }
}

#[cfg(not(target_os = "linux"))]
fn nice() -> Background {
    Background::Refused("not on this system".into())
}

#[cfg(not(target_os = "linux"))]
fn idle() -> Background {
    nice()
}

impl std::fmt::Display for Background {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Nice => f.write_str("niceness 10"),
            Self::Idle => f.write_str("SCHED_IDLE"),
            Self::Refused(why) => write!(f, "no lower priority ({why})"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever this computer permits, the report and the kernel agree.
    #[test]
    fn the_report_is_what_the_kernel_says() {
        std::thread::spawn(|| {
            let report = realtime(10, false);
            let policy = thread_priority::thread_schedule_policy()
                .map(|p| p == ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo));
            assert_eq!(report.fifo.is_ok(), policy == Ok(true), "{report}");
            assert!(report.to_string().contains("SCHED_FIFO"), "{report}");
        })
        .join()
        .unwrap();
    }

    /// Both ways, whatever this computer permits the control thread: the kernel says what was done.
    #[test]
    fn the_background_is_behind() {
        let granted = Realtime { fifo: Ok(80), locked: Err(String::new()) };
        let refused = Realtime { fifo: Err(String::new()), locked: Err(String::new()) };
        std::thread::spawn(move || {
            assert_eq!(background(&granted), Background::Nice);
            assert_eq!(rustix::process::getpriority_process(None), Ok(10));
            // Threads started here are as nice.
            let started = std::thread::spawn(|| rustix::process::getpriority_process(None));
            assert_eq!(started.join().unwrap(), Ok(10));
            assert_eq!(background(&refused), Background::Idle);
            let policy = thread_priority::thread_schedule_policy();
            let idle = ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Idle);
            assert!(matches!(policy, Ok(p) if p == idle), "{policy:?}");
        })
        .join()
        .unwrap();
    }
}
