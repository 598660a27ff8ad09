"""Observations of a legged robot: each a function of a `LocomotionState` that returns (num_envs, size)."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from numpy.typing import ArrayLike

from stickslip.envs.locomotion_state import Array, LocomotionState

__all__ = [
    "ObservationTerm",
    "actions",
    "base_angular_velocity",
    "base_linear_velocity",
    "commands",
    "default_observations",
    "joint_position",
    "joint_velocity",
    "projected_gravity",
]


class ObservationTerm(NamedTuple):
    """A part of the observation: `scale` times what `function` returns."""

    function: Callable[[LocomotionState], Array]
    scale: ArrayLike = 1.0  #: a number or one per element
    noise: ArrayLike = 0.0  #: uniform, +- this, before the scale; used with `observation_noise=True`


def _entry(name: str, doc: str) -> Callable[[LocomotionState], Array]:
    """The term that is an entry of the state as it is; a module-level name like any function, so that it can be pickled."""

    def term(state: LocomotionState) -> Array:
        return getattr(state, name)

    term.__name__ = term.__qualname__ = name
    term.__doc__ = doc
    return term


base_linear_velocity = _entry("base_linear_velocity", "(n, 3) of the base origin, base axes [m/s].")
base_angular_velocity = _entry("base_angular_velocity", "(n, 3) base axes [rad/s].")
projected_gravity = _entry("projected_gravity", "(n, 3) unit vector of gravity in base axes: where is down.")
commands = _entry("commands", "(n, 3) wanted velocity forward, to the left [m/s], and yaw rate [rad/s].")
joint_position = _entry("joint_position", "(n, joints) offset from the default angles [rad].")
joint_velocity = _entry("joint_velocity", "(n, joints) [rad/s].")
actions = _entry("actions", "(n, actions) the last ones.")


def default_observations() -> dict[str, ObservationTerm]:
    """48 numbers in the order, with the scales and the noise of legged_gym."""
    return {
        "base_linear_velocity": ObservationTerm(base_linear_velocity, 2.0, 0.1),
        "base_angular_velocity": ObservationTerm(base_angular_velocity, 0.25, 0.2),
        "projected_gravity": ObservationTerm(projected_gravity, 1.0, 0.05),
        "commands": ObservationTerm(commands, (2.0, 2.0, 0.25)),
        "joint_position": ObservationTerm(joint_position, 1.0, 0.01),
        "joint_velocity": ObservationTerm(joint_velocity, 0.05, 1.5),
        "actions": ObservationTerm(actions),
    }
