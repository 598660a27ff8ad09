"""Commanded velocities of a legged robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stickslip._arguments import interval
from stickslip.envs.locomotion_state import Array
from stickslip.envs.streams import Envs, RandomStreams

__all__ = ["Commands", "uniform_commands"]

Range = tuple[float, float]


@dataclass
class Commands:
    """What is commanded, and for how long."""

    forward: Range = (-1.0, 1.0)  #: velocity along the base's x [m/s]
    left: Range = (-1.0, 1.0)  #: along its y [m/s]
    yaw_rate: Range = (-1.0, 1.0)  #: [rad/s]
    seconds: float = 10.0  #: until the next command; infinite: never [s]
    least_speed: float = 0.2  #: slower ones become zero, so that standing is learned too [m/s]
    standing: float = 0.02  #: probability of a command to stand still

    def check(self) -> None:
        """TypeError or ValueError names the field that cannot be."""
        for name in ("forward", "left", "yaw_rate"):
            low, high = interval(f"commands.{name}", getattr(self, name))
            if not np.isfinite([low, high]).all():
                raise ValueError(f"commands.{name} is {(low, high)}; it must be finite")
        if not self.seconds > 0:
            raise ValueError(f"commands.seconds is {self.seconds}; it must be positive")


def uniform_commands(random: RandomStreams, envs: Envs, commands: Commands) -> Array:
    """(k, 3) velocity forward, to the left, yaw rate; uniform in their ranges."""
    low, high = np.transpose([commands.forward, commands.left, commands.yaw_rate])
    drawn = random.uniform(envs, np.append(low, 0.0), np.append(high, 1.0), 4)
    command = drawn[:, :3]
    slow = command[:, 0] ** 2 + command[:, 1] ** 2 < commands.least_speed**2
    command[slow, :2] = 0.0
    command[drawn[:, 3] < commands.standing] = 0.0
    return command
