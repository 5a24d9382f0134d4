#!/usr/bin/env python3
"""Trains Stable-Baselines3's SAC on the same task, with the learner's settings of the default preset where SB3 has them.

    pip install ./python stable-baselines3
    python3 python/train_sb3.py --steps 20000 --seed 1
"""

import argparse

import gymnasium as gym
import palpate_gym  # noqa: F401  registers the environment
from stable_baselines3 import SAC
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", default="peg-insertion")
    parser.add_argument("--model", default="P-14", help="policy model: P-9 … A-18")
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--episodes", type=int, default=20, help="of the evaluation afterwards")
    args = parser.parse_args()
    make = lambda: Monitor(gym.make("palpate/Insertion-v0", task=args.task, model=args.model), info_keywords=())
    agent = SAC(
        "MlpPolicy",
        make(),
        learning_rate=3e-4,
        batch_size=128,
        gamma=0.98,
        tau=0.005,
        gradient_steps=2,
        learning_starts=128,
        ent_coef="auto_0.02",
        target_entropy=0.0,
        seed=args.seed,
        verbose=1,
    )
    agent.learn(args.steps, log_interval=10)

    test = make()
    test.reset(seed=1000)
    outcomes = []
    returns, lengths = evaluate_policy(
        agent,
        test,
        n_eval_episodes=args.episodes,
        return_episode_rewards=True,
        callback=lambda local, _: outcomes.append(local["info"]["is_success"]) if "is_success" in local["info"] else None,
    )
    print(f"success {sum(outcomes):.0f} of {len(outcomes)}, mean return {sum(returns) / len(returns):.1f}, mean length {sum(lengths) / len(lengths):.1f}")


if __name__ == "__main__":
    main()
