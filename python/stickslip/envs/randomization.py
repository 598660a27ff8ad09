"""What differs between environments and episodes: functions of a task and of the indices `envs` (k,) whose episodes begin.

Each draws from the streams of those environments (`task.random`) and writes rows of `task.batch`. Parameters are bound with
`functools.partial(friction, low=0.2)`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from stickslip._arguments import interval, number

if TYPE_CHECKING:
    from stickslip.envs.anymal_flat import AnymalFlat

__all__ = ["Pushes", "base_mass", "default_randomization", "friction", "initial_state", "push"]

Indices = NDArray[np.int64]
UPPER = np.triu_indices(3)  # xx xy xz yy yz zz of a matrix
Randomization = Callable[["AnymalFlat", Indices], None]


def friction(task: AnymalFlat, envs: Indices, low: float = 0.5, high: float = 1.25) -> None:
    """One Coulomb coefficient for all shapes of a robot."""
    low, high = _bounds("friction", low, high)
    if not low >= 0:
        raise ValueError(f"friction: low is {low}; it must be zero or positive")
    task.batch.friction[envs] = task.random.uniform(envs, low, high)[:, None]


def base_mass(task: AnymalFlat, envs: Indices, low: float = -5.0, high: float = 5.0) -> None:
    """Adds mass to the base [kg]; its inertia grows in proportion, its center of mass stays."""
    low, high = _bounds("base_mass", low, high)
    if not np.float32(1.0 + low / task.base.mass) > 0:
        raise ValueError(f"base_mass: low is {low}; the base has {task.base.mass} kg and must keep some")
    ratio = 1.0 + task.random.uniform(envs, low, high) / task.base.mass
    task.batch.body_mass[envs, 0] = ratio * task.base.mass
    task.batch.body_inertia[envs, 0] = ratio[:, None] * task.base.inertia[UPPER]


def _bounds(name: str, low: float, high: float) -> tuple[float, float]:
    """Finite bounds of what a function draws."""
    low, high = interval(f"{name}: (low, high)", (low, high))
    return number(f"{name}: low", low), number(f"{name}: high", high)


def initial_state(
    task: AnymalFlat, envs: Indices, joint_scale: tuple[float, float] = (0.5, 1.5), speed: float = 0.5
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """q (k, nq), u (k, nu): above the origin, any heading, default joint angles times a factor, base velocities up to `speed`."""
    joints = len(task.default_angles)
    scale = task.random.uniform(envs, *joint_scale, joints)
    velocity = task.random.uniform(envs, -speed, speed, 6)
    half_yaw = task.random.uniform(envs, -np.pi / 2, np.pi / 2).astype(np.float64)
    q = np.zeros((len(envs), 7 + joints))
    u = np.zeros((len(envs), 6 + joints))
    q[:, 2] = task.config.base_height
    q[:, 3], q[:, 6] = np.cos(half_yaw), np.sin(half_yaw)
    q[:, 7:] = task.default_angles * scale
    u[:, :6] = velocity
    return q, u


def push(task: AnymalFlat, envs: Indices, speed: float = 0.5) -> None:
    """Adds a horizontal velocity of up to `speed` along x and y to the base [m/s]."""
    task.batch.u[envs, :2] += task.random.uniform(envs, -speed, speed, 2)


@dataclass
class Pushes:
    """When and how robots are pushed."""

    seconds: tuple[float, float] = (10.0, 15.0)  #: since the beginning or the last push [s]; infinite: never
    function: Randomization = push

    def check(self) -> None:
        """TypeError or ValueError names the field that cannot be."""
        if not interval("pushes.seconds", self.seconds)[0] > 0:
            raise ValueError(f"pushes.seconds is {self.seconds}; it must be positive")


def default_randomization() -> dict[str, Randomization]:
    """As legged_gym."""
    return {"friction": friction, "base_mass": base_mass}
