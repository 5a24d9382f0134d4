"""palpate's simulated insertion tasks as Gymnasium environments.

The environment is the project's own: 20 actions a second, a 500 Hz force controller and the fail-safe layer behind them.
An action in [-1, 1] is a motion and the controller's gains, see ``action_labels``.

    import gymnasium, palpate_gym
    env = gymnasium.make("palpate/Insertion-v0", task="peg-insertion", model="A-13pd")
"""

import gymnasium as gym
import numpy as np

from ._palpate import Sim


class Insertion(gym.Env):
    """An insertion task. ``settings`` are overrides as on the command line, e.g. ``{"sim.friction": 0.5}``."""

    metadata = {"render_modes": []}

    def __init__(self, task="peg-insertion", model="P-14", preset="palpate", settings=None, render_mode=None):
        self.render_mode = render_mode
        overrides = [f"{key}={value}" for key, value in (settings or {}).items()]
        self._sim = Sim(preset, task, model, overrides)
        self.action_labels = self._sim.action_labels
        self.observation_space = gym.spaces.Box(-np.inf, np.inf, (self._sim.observation_dim,), np.float32)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (self._sim.action_dim,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.asarray(self._sim.reset(seed), np.float32), {}

    def step(self, action):
        action = np.asarray(action, np.float64).tolist()
        observation, reward, terminated, truncated, info = self._sim.step(action)
        return np.asarray(observation, np.float32), reward, terminated, truncated, info


# Episodes end at env.max_steps by themselves, so Gymnasium needs no time limit around it.
gym.register(id="palpate/Insertion-v0", entry_point=Insertion)
