"""Gymnasium's own checker, and what it does not check. Run: pytest python/tests"""

import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import palpate_gym


@pytest.mark.parametrize("model", ["P-14", "A-13pd"])
def test_gymnasium_accepts_it(model):
    env = gym.make("palpate/Insertion-v0", model=model)
    with warnings.catch_warnings():
        # Observations have no bound that is known beforehand.
        warnings.filterwarnings("error")
        warnings.filterwarnings("ignore", message=".*(infinity|-infinity|render_modes|render mode).*")
        check_env(env.unwrapped, skip_render_check=True)


def rollout(env, seed, actions):
    observation, _ = env.reset(seed=seed)
    out = [observation]
    for action in actions:
        observation, reward, terminated, truncated, _ = env.step(action)
        out.append(np.append(observation, reward))
        if terminated or truncated:
            break
    return np.concatenate(out)


def test_a_seed_is_an_episode_to_the_last_bit():
    env = palpate_gym.Insertion()
    actions = np.random.default_rng(1).uniform(-1, 1, (60, env.action_space.shape[0]))
    first = rollout(env, 3, actions)
    rollout(env, 4, actions)
    assert np.array_equal(first, rollout(env, 3, actions))
    assert not np.array_equal(first, rollout(env, 4, actions))


def test_an_episode_ends_and_says_how():
    env = palpate_gym.Insertion(settings={"env.max_steps": 5})
    env.reset(seed=1)
    for step in range(5):
        _, _, terminated, truncated, info = env.step(np.zeros(env.action_space.shape))
    assert truncated and not terminated
    assert info["is_success"] == 0.0 and info["peak_force"] >= 0.0
    with pytest.raises(RuntimeError, match="reset"):
        env.step(np.zeros(env.action_space.shape))


def test_a_wrong_setting_names_the_right_one():
    with pytest.raises(RuntimeError, match="sim.friction"):
        palpate_gym.Insertion(settings={"sim.fricton": 0.1})
