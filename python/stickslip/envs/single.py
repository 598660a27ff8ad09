"""One environment of a task, as `gymnasium.make` wants it: a thin wrapper on a batch of one."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from stickslip.envs.infos import of_one
from stickslip.envs.task import VectorTask

__all__ = ["SingleTask", "single"]


class SingleTask(gymnasium.Env):
    """A `gymnasium.Env` that steps `task_class` with one environment; options are those of the task, without `autoreset_mode`.

    Episodes last the task's `episode_seconds`; `max_episode_steps` of `gymnasium.make` is Gymnasium's own, shorter limit.
    """

    task_class: type[VectorTask]
    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    def __init__(self, *, num_threads: int = 1, **options: Any):
        self.task = self.task_class(1, autoreset_mode=AutoresetMode.DISABLED, num_threads=num_threads, **options)
        self.observation_space = self.task.single_observation_space
        self.action_space = self.task.single_action_space
        self._first = True

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begins an episode; the same seed gives the same bits."""
        super().reset(seed=seed)
        if seed is None and self._first:
            seed = self.np_random_seed if self.np_random_seed >= 0 else None
        observation, infos = self.task.reset(seed=seed)
        self._first = False
        return observation[0], of_one(infos)

    def step(self, action: ArrayLike) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """One action (action_size,); errors and infos are those of the task."""
        if np.shape(action) != self.action_space.shape:
            raise ValueError(f"action has shape {np.shape(action)}; it must be {self.action_space.shape}")
        observations, rewards, terminated, truncated, infos = self.task.step(np.asarray(action)[None])
        return observations[0], float(rewards[0]), bool(terminated[0]), bool(truncated[0]), of_one(infos)

    def close(self) -> None:
        """Gives memory and threads back."""
        self.task.close()


def single(task_class: type[VectorTask]) -> type[SingleTask]:
    """The single environment of a task."""
    return type(f"{task_class.__name__}Env", (SingleTask,), {"task_class": task_class, "__doc__": task_class.__doc__})
