//! Every verdict other than a plain pass, with its circumstances: counted always, kept for a while.

use palpate_spatial::{JointVector, Wrench};

macro_rules! causes {
    ($($(#[$doc:meta])* $cause:ident = $name:literal,)*) => {
        /// Why a command was not simply passed on.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
        #[serde(rename_all = "kebab-case")]
        pub enum Cause { $($(#[$doc])* $cause,)* }

        impl Cause {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$cause,)*];

            /// As in files.
            pub fn name(self) -> &'static str {
                match self { $(Self::$cause => $name,)* }
            }
        }
    };
}

causes! {
    /// The command was not finite. Braked.
    NonFinite = "non-finite",
    /// No inverse-kinematics solution. Braked.
    NoIk = "no-ik",
    /// The solution is on another branch, or the command jumped. Braked.
    Branch = "branch",
    /// The command, or the end of its brake, is outside a joint's range. Braked.
    JointRange = "joint-range",
    /// The brake would exceed a joint's speed. Braked.
    JointSpeed = "joint-speed",
    /// The step or its brake would leave the workspace box. Braked.
    Workspace = "workspace",
    /// The step or its brake would come too near to a plane. Braked.
    Plane = "plane",
    /// The step or its brake would bring the arm too near to itself. Braked.
    SelfCollision = "self-collision",
    /// The force limit was exceeded in 2 of 3 samples. Latched.
    ForceSoft = "force-soft",
    /// The hard force limit was exceeded, or soon will be. Latched.
    ForceHard = "force-hard",
    /// A command while a force stop is latched: brake, retreat or rest.
    Stopped = "stopped",
    /// The force is rising towards its limit too fast. Braked.
    ForceRising = "force-rising",
    /// The sample is not to be believed. Braked.
    Implausible = "implausible",
    /// The measured joints are too far from their set-points. Braked.
    Tracking = "tracking",
    /// Slowed: a joint would be too fast.
    SlowedBySpeed = "slowed-by-speed",
    /// Slowed: too little force left for this approach speed.
    SlowedByForce = "slowed-by-force",
    /// Slowed: towards an obstacle.
    SlowedByObstacle = "slowed-by-obstacle",
    /// Slowed: towards a singularity.
    SlowedBySingularity = "slowed-by-singularity",
    /// Followed as fast as acceleration and jerk allow.
    Shaped = "shaped",
}

impl Cause {
    /// Whether the arm follows, but not as fast as it was asked to: a timed path should wait.
    pub fn is_slowed(self) -> bool {
        matches!(
            self,
            Self::SlowedBySpeed
                | Self::SlowedByForce
                | Self::SlowedByObstacle
                | Self::SlowedBySingularity
        )
    }
}

/// Verdicts by cause, in control ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts([u64; Cause::ALL.len()]);

impl Counts {
    /// How often this cause was given.
    pub fn of(&self, cause: Cause) -> u64 {
        self.0[cause as usize]
    }

    /// All causes with their counts.
    pub fn iter(&self) -> impl Iterator<Item = (Cause, u64)> {
        Cause::ALL.iter().map(|&cause| (cause, self.of(cause)))
    }
}

impl std::ops::Sub for Counts {
    type Output = Self;
    fn sub(self, earlier: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] - earlier.0[i]))
    }
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.0.iter_mut().zip(other.0).for_each(|(count, more)| *count += more);
    }
}

impl serde::Serialize for Counts {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let given = self.iter().filter(|(_, count)| *count > 0);
        serializer.collect_map(given.map(|(cause, count)| (cause.name(), count)))
    }
}

impl<'de> serde::Deserialize<'de> for Counts {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let given = std::collections::BTreeMap::<Cause, u64>::deserialize(deserializer)?;
        let mut counts = Self::default();
        for (cause, count) in given {
            counts.0[cause as usize] = count;
        }
        Ok(counts)
    }
}

/// One verdict, or the same verdict in tick after tick: then all is that of the first but `ticks` and `distance`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Entry {
    /// The robot's clock, s.
    pub time: f64,
    /// Control ticks in a row.
    pub ticks: u32,
    /// Why.
    pub cause: Cause,
    /// What was asked for, as joints, rad; none where no joints were found.
    pub proposed: Option<JointVector>,
    /// What was sent, rad.
    pub executed: JointVector,
    /// Filtered contact wrench, base axes, about the tool centre point.
    pub wrench: Wrench,
    /// Least distance to the limit that decided, in the limit's own unit; negative: beyond it; NaN: not a distance.
    pub distance: f64,
}

/// A ring of the latest entries and counts of all.
#[derive(Clone, Debug)]
pub struct Ledger {
    ring: Vec<Entry>,
    capacity: usize,
    /// Where the next entry goes once the ring is full.
    next: usize,
    /// Time between ticks, s.
    period: f64,
    counts: Counts,
}

impl Ledger {
    /// A ledger that keeps the latest `capacity` entries of ticks `period` (s) apart; all memory is taken here.
    pub fn new(capacity: usize, period: f64) -> Self {
        let (ring, counts) = (Vec::with_capacity(capacity), Counts::default());
        Self { ring, capacity, next: 0, period, counts }
    }

    /// Counts the verdict of one tick and keeps it.
    pub fn add(&mut self, entry: Entry) {
        self.counts.0[entry.cause as usize] += 1;
        let period = self.period;
        if let Some(newest) = self.newest()
            && newest.cause == entry.cause
            && (entry.time - newest.time - f64::from(newest.ticks) * period).abs() < 0.5 * period
        {
            newest.ticks += 1;
            newest.distance = newest.distance.min(entry.distance);
            return;
        }
        if self.ring.len() < self.capacity {
            self.ring.push(entry);
        } else if let Some(oldest) = self.ring.get_mut(self.next) {
            *oldest = entry;
            self.next = (self.next + 1) % self.capacity;
        }
    }

    fn newest(&mut self) -> Option<&mut Entry> {
        let newest = (self.next + self.ring.len()).checked_sub(1)? % self.ring.len().max(1);
        self.ring.get_mut(newest)
    }

    /// Verdicts by cause since the beginning.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// The entries kept, oldest first.
    pub fn entries(&self) -> impl Iterator<Item = &Entry> {
        let (newer, older) = self.ring.split_at(self.next);
        older.iter().chain(newer)
    }

    /// Empties the ring, for instance once it was written to a file. The counts go on.
    pub fn clear_entries(&mut self) {
        self.ring.clear();
        self.next = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(time: f64, cause: Cause) -> Entry {
        let executed = JointVector::zeros();
        let (proposed, wrench, distance) = (None, Wrench::zero(), -time);
        Entry { time, ticks: 1, cause, proposed, executed, wrench, distance }
    }

    #[test]
    fn the_ring_keeps_the_latest_and_the_counts_keep_all() {
        let mut ledger = Ledger::new(3, 1.0);
        for i in 0..8 {
            let cause = if i % 2 == 0 { Cause::NoIk } else { Cause::Plane };
            ledger.add(entry(f64::from(i), cause));
        }
        let times: Vec<_> = ledger.entries().map(|e| e.time).collect();
        assert_eq!(times, [5.0, 6.0, 7.0]);
        assert_eq!((ledger.counts().of(Cause::NoIk), ledger.counts().of(Cause::Plane)), (4, 4));
        let before = ledger.counts();
        ledger.clear_entries();
        ledger.add(entry(9.0, Cause::Plane));
        assert_eq!(ledger.entries().count(), 1);
        assert_eq!((ledger.counts() - before).of(Cause::Plane), 1);
    }

    #[test]
    fn the_same_verdict_in_a_row_is_one_entry() {
        for full in [false, true] {
            let mut ledger = Ledger::new(3, 0.002);
            if full {
                (0..5).for_each(|i| ledger.add(entry(-1.0 - f64::from(i), Cause::Branch)));
            }
            for tick in [0, 1, 2, 3, 7, 8] {
                ledger.add(entry(0.002 * f64::from(tick), Cause::JointSpeed));
            }
            let kept: Vec<_> = ledger.entries().filter(|e| e.cause == Cause::JointSpeed).collect();
            assert_eq!((kept[0].time, kept[0].ticks, kept[0].distance), (0.0, 4, -0.006));
            assert_eq!((kept[1].time, kept[1].ticks), (0.014, 2));
            assert_eq!((kept.len(), ledger.counts().of(Cause::JointSpeed)), (2, 6));
        }
    }

    #[test]
    fn a_ledger_without_room_still_counts() {
        let mut ledger = Ledger::new(0, 1.0);
        ledger.add(entry(0.0, Cause::Shaped));
        assert_eq!((ledger.entries().count(), ledger.counts().of(Cause::Shaped)), (0, 1));
    }

    #[test]
    fn every_cause_has_a_place_and_the_name_that_serde_gives_it() {
        for (i, &cause) in Cause::ALL.iter().enumerate() {
            assert_eq!(cause as usize, i);
            let value = toml::Value::try_from(cause).unwrap();
            assert_eq!(value.as_str(), Some(cause.name()));
        }
    }
}
