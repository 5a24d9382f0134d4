//! It learns: a bandit in a moment, a cart on a rail in seconds.

use palpate_sac::{Mode, Sac, SacConfig, TargetEntropy, Transition};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn small() -> SacConfig {
    SacConfig {
        hidden: vec![32, 32],
        batch_size: 64,
        start_training: 64,
        actor_learning_rate: 1e-3,
        critic_learning_rate: 1e-3,
        reward_scale: 1.0,
        n_step: 1,
        ..SacConfig::default()
    }
}

#[test]
fn a_bandit_finds_the_best_action() {
    let config = SacConfig { target_entropy: TargetEntropy::Nats(-2.0), ..small() };
    let mut agent = Sac::new(&config, 1, 2, 3).unwrap();
    let mut action = [0.0; 2];
    for _ in 0..600 {
        agent.act(&[1.0], Mode::Explore, &mut action).unwrap();
        let reward = -(action[0] - 0.6).powi(2) - (action[1] + 0.3).powi(2);
        let transition = Transition {
            observation: &[1.0],
            action: &action,
            reward,
            next_observation: &[1.0],
            terminal: true,
            episode_end: true,
        };
        agent.observe(&transition).unwrap();
        agent.update().unwrap();
    }
    agent.act(&[1.0], Mode::Exploit, &mut action).unwrap();
    assert!((action[0] - 0.6).abs() < 0.1 && (action[1] + 0.3).abs() < 0.1, "{action:?}");
}

/// A cart on a rail: position and velocity, pushed by the action; the reward is −x² − 0.1·v².
struct Cart {
    x: f32,
    v: f32,
}

const STEPS: usize = 50;

impl Cart {
    fn drawn(rng: &mut ChaCha8Rng) -> Self {
        Self { x: rng.random_range(-1.0..1.0), v: 0.0 }
    }

    fn step(&mut self, push: f32) -> f32 {
        self.v += 0.1 * (2.0 * push - 0.2 * self.v);
        self.x += 0.1 * self.v;
        -self.x * self.x - 0.1 * self.v * self.v
    }

    fn see(&self) -> [f32; 2] {
        [self.x, self.v]
    }
}

/// Mean return of a policy over the same twenty starts.
fn score(mut policy: impl FnMut(&[f32; 2]) -> f32) -> f32 {
    let mut rng = ChaCha8Rng::seed_from_u64(99);
    let episode = |_| {
        let mut cart = Cart::drawn(&mut rng);
        (0..STEPS).map(|_| cart.step(policy(&cart.see()))).sum::<f32>()
    };
    (0..20).map(episode).sum::<f32>() / 20.0
}

#[test]
fn a_cart_is_brought_to_rest() {
    let mut agent = Sac::new(&SacConfig { n_step: 5, ..small() }, 2, 1, 4).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut action = [0.0];
    for _ in 0..40 {
        let mut cart = Cart::drawn(&mut rng);
        for step in 0..STEPS {
            let before = cart.see();
            agent.act(&before, Mode::Explore, &mut action).unwrap();
            let reward = cart.step(action[0]);
            let transition = Transition {
                observation: &before,
                action: &action,
                reward,
                next_observation: &cart.see(),
                terminal: false,
                episode_end: step + 1 == STEPS,
            };
            agent.observe(&transition).unwrap();
            agent.update().unwrap();
        }
    }
    let learned = score(|o| {
        agent.act(o, Mode::Exploit, &mut action).unwrap();
        action[0]
    });
    let mut noise = ChaCha8Rng::seed_from_u64(6);
    let random = score(|_| noise.random_range(-1.0..1.0));
    let idle = score(|_| 0.0);
    let engineer = score(|o| (-2.0 * o[0] - 1.5 * o[1]).clamp(-1.0, 1.0));
    println!("learned {learned:.2}, idle {idle:.2}, random {random:.2}, engineer {engineer:.2}");
    assert!(
        learned > 1.5 * engineer && engineer > 0.5 * idle,
        "{learned} {engineer} {idle} {random}"
    );
}
