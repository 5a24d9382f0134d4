//! The policy on its way from the learner to the arm.

use std::sync::{Arc, Mutex};

use palpate_sac::Policy;

/// The newest policy on its way from the learner to the arm.
///
/// The two policies change places, so that neither side frees or copies the other's. The arm's side never
/// waits: while the learner has its hand on the slot, it keeps the policy it has.
#[derive(Clone, Debug, Default)]
pub(super) struct Exchange(Arc<Mutex<Option<Box<Slot>>>>);

#[derive(Debug)]
struct Slot {
    policy: Policy,
    fresh: bool,
}

impl Exchange {
    /// The learner's side.
    pub(super) fn offer(&self, policy: Policy) {
        let mut slot = Some(Box::new(Slot { policy, fresh: true }));
        if let Ok(mut shared) = self.0.lock() {
            std::mem::swap(&mut *shared, &mut slot);
        }
        // The old one is freed here, after the lock.
        drop(slot);
    }

    /// The hand of a learner on the slot, for as long as what comes back is kept.
    #[cfg(test)]
    pub(super) fn hand(&self) -> impl Sized {
        self.0.lock()
    }

    /// The arm's side.
    pub(super) fn take(&self, policy: &mut Policy) {
        if let Ok(mut shared) = self.0.try_lock()
            && let Some(slot) = shared.as_mut().filter(|slot| slot.fresh)
        {
            std::mem::swap(&mut slot.policy, policy);
            slot.fresh = false;
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use palpate_sac::Sac;

    pub(in crate::real) fn policy(seed: u64) -> Policy {
        let config =
            palpate_sac::SacConfig { hidden: vec![8], ..palpate_sac::SacConfig::default() };
        Sac::new(&config, 18, 14, seed).unwrap().policy()
    }

    fn mean(policy: &mut Policy) -> Vec<f32> {
        let mut action = vec![0.0; policy.action_dim()];
        policy.mean(&[0.1; 18], &mut action);
        action
    }

    #[test]
    fn the_arm_takes_the_newest_policy_once_and_never_waits() {
        let (exchange, mut acting) = (Exchange::default(), policy(1));
        exchange.take(&mut acting);
        assert_eq!(mean(&mut acting), mean(&mut policy(1)), "nothing was offered");
        exchange.offer(policy(2));
        exchange.offer(policy(3));
        {
            let _learner = exchange.0.lock();
            exchange.take(&mut acting);
            assert_eq!(mean(&mut acting), mean(&mut policy(1)), "the learner has its hand on it");
        }
        exchange.take(&mut acting);
        assert_eq!(mean(&mut acting), mean(&mut policy(3)));
        exchange.take(&mut acting);
        assert_eq!(mean(&mut acting), mean(&mut policy(3)), "an old one came back");
    }
}
