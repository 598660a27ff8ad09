"""The tasks of [Hwangbo 2018] section V, and of the comparison with other simulators, on ANYmal B.

"trot" (at 1.5 m/s), "hang" (thrown at rest, only the feet collide), "drop" (thrown at 1 m/s, until motion dies), "random" (PD
control to random targets), "stand", "open_loop_trot". What an episode does is a pure function of task, episode and step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stickslip import _core, assets
from stickslip._arguments import count
from stickslip.world import World

__all__ = ["TASKS", "Scene", "Statistics", "initial_state"]

TASKS: tuple[str, ...] = tuple(_core.scenes.task_names())
Statistics = _core.scenes.Statistics


def initial_state(task: str, episode: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """q (19,) and u (18,) at the start of an episode. ValueError lists the tasks."""
    return _core.scenes.initial_state(task, count("episode", episode))


class Scene:
    """A world with ground and ANYmal, and a task that drives it.

    task: one of `TASKS`. settle: penetration counts only after so much of an episode [s]. track_energy: also look for growth
    of energy, at the cost of a mass matrix per step. options: of `World`.
    """

    def __init__(
        self,
        task: str,
        time_step: float = 1e-3,
        *,
        episode: int = 0,
        settle: float = 2.0,
        track_energy: bool = False,
        **options,
    ):
        model = _core.scenes.task_model(task, _core.load_urdf(assets.path("anymal_b")))
        self.task = task
        self.world = World(time_step, **options)
        self.world.add_ground()
        self.robot = self.world.add_robot(model)
        self._settle, self._track_energy = settle, track_energy
        self._task = _core.scenes.Task(task, time_step)
        self.reset(episode)

    @property
    def episode(self) -> int:
        """Number of the episode."""
        return self._task.episode

    @property
    def time(self) -> float:
        """Since the episode began [s]."""
        return self._task.time

    def reset(self, episode: int) -> None:
        """Begins an episode, with fresh statistics."""
        self._task.reset(self.robot._core, count("episode", episode))
        self.statistics = Statistics(self.world._core, self._settle, self._track_energy)
        self.statistics.begin(self.robot._core)

    def run(self, steps: int) -> int:
        """Takes so many steps, beginning the next episode where one is over; returns how many ended."""
        return self._task.run(self.world._core, self.robot._core, count("steps", steps), self.statistics)
