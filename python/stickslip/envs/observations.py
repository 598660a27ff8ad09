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


def base_linear_velocity(state: LocomotionState) -> Array:
    """(n, 3) of the base origin, base axes [m/s]."""
    return state.base_linear_velocity


def base_angular_velocity(state: LocomotionState) -> Array:
    """(n, 3) base axes [rad/s]."""
    return state.base_angular_velocity


def projected_gravity(state: LocomotionState) -> Array:
    """(n, 3) unit vector of gravity in base axes: where is down."""
    return state.projected_gravity


def commands(state: LocomotionState) -> Array:
    """(n, 3) wanted velocity forward, to the left [m/s], and yaw rate [rad/s]."""
    return state.commands


def joint_position(state: LocomotionState) -> Array:
    """(n, joints) offset from the default angles [rad]."""
    return state.joint_position


def joint_velocity(state: LocomotionState) -> Array:
    """(n, joints) [rad/s]."""
    return state.joint_velocity


def actions(state: LocomotionState) -> Array:
    """(n, actions) the last ones."""
    return state.actions


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
