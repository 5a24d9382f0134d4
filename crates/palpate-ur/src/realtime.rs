//! What this computer grants the thread that talks to the arm.

use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
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
/// is 1 to 99; stay below 99, where the kernel's own threads are. Locking covers the memory there is and
/// will be, so a learner with gigabytes belongs into another process.
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

#[cfg(target_os = "linux")]
fn lock_memory() -> Result<(), String> {
    use rustix::mm::{MlockAllFlags, mlockall};
    mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE).map_err(|e| {
        format!("mlockall is not permitted ({e}): set memlock in /etc/security/limits.d, or CAP_IPC_LOCK")
    })
}

#[cfg(not(target_os = "linux"))]
fn lock_memory() -> Result<(), String> {
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
}
