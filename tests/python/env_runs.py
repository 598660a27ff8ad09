"""Environments and runs that the tests of `stickslip.envs` share."""

from __future__ import annotations

from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from stickslip.envs import AnymalFlat, AnymalFlatConfig, commands, randomization

ID = "stickslip/AnymalFlat-v0"
MODES = list(AutoresetMode)


def lively() -> AnymalFlatConfig:
    """Short episodes in which everything happens: falls, time limits, new commands, pushes, noise."""
    return AnymalFlatConfig(
        episode_seconds=0.5,
        observation_noise=True,
        commands=commands.Commands(seconds=0.14),
        pushes=randomization.Pushes(seconds=(0.06, 0.2)),
        initial_state=partial(randomization.initial_state, speed=3.0),
    )


def make(num_envs: int = 4, mode: AutoresetMode = AutoresetMode.NEXT_STEP, **options: Any) -> AnymalFlat:
    options.setdefault("config", lively())
    return gymnasium.make_vec(ID, num_envs=num_envs, autoreset_mode=mode, **options)


def action_of(env: int, step: int) -> np.ndarray:
    """(12,) whatever the number of environments."""
    return np.random.default_rng([env, step]).normal(0.0, 1.0, 12).astype(np.float32)


def actions_of(step: int, num_envs: int) -> np.ndarray:
    return np.stack([action_of(env, step) for env in range(num_envs)])


def run(envs: Any, steps: int, num_envs: int | None = None) -> list[tuple]:
    """Steps with `actions_of`; "Disabled": resets what ended."""
    results = []
    for step in range(steps):
        result = envs.step(actions_of(step, envs.num_envs))
        if envs.metadata["autoreset_mode"] is AutoresetMode.DISABLED and (result[2] | result[3]).any():
            observation, _ = envs.reset(options={"reset_mask": result[2] | result[3]})
            result = (observation, *result[1:])
        results.append(tuple(array[:num_envs] for array in result[:4]) + result[4:])
    return results


def assert_same_steps(a: list[tuple], b: list[tuple]) -> None:
    for step, (left, right) in enumerate(zip(a, b, strict=True)):
        for name, x, y in zip(("observation", "reward", "terminated", "truncated"), left, right, strict=False):
            assert np.array_equal(x, y), f"{name} differs in step {step}"
