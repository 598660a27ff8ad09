"""Reward terms of a legged robot: each a function of a `LocomotionState` that returns (num_envs,), without weight and sign.

A configuration gives each a weight; the environment adds weight * function(state) * control step [s]. Parameters are bound with
`functools.partial(track_linear_velocity, variance=0.1)`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stickslip.envs.locomotion_state import Array, LocomotionState

__all__ = [
    "action_rate",
    "alive",
    "base_height",
    "default_rewards",
    "feet_air_time",
    "joint_acceleration",
    "joint_deviation",
    "joint_torque",
    "orientation",
    "roll_pitch_rate",
    "stand_still",
    "track_linear_velocity",
    "track_yaw_rate",
    "undesired_contacts",
    "vertical_velocity",
]

Reward = Callable[[LocomotionState], Array]


def _square_sum(x: Array) -> Array:
    return np.einsum("ij,ij->i", x, x)


def _is_moving(commands: Array, least: float) -> Array:
    """(n,) bool: the wanted speed is above `least` [m/s]."""
    return commands[:, 0] ** 2 + commands[:, 1] ** 2 > least * least


def track_linear_velocity(state: LocomotionState, variance: float = 0.25) -> Array:
    """exp(-error^2 / variance) of the horizontal velocity [(m/s)^2]: 1 where it is as commanded."""
    x = state.commands[:, 0] - state.base_linear_velocity[:, 0]
    y = state.commands[:, 1] - state.base_linear_velocity[:, 1]
    return np.exp((x * x + y * y) * np.float32(-1.0 / variance))


def track_yaw_rate(state: LocomotionState, variance: float = 0.25) -> Array:
    """exp(-error^2 / variance) of the yaw rate [(rad/s)^2]."""
    error = state.commands[:, 2] - state.base_angular_velocity[:, 2]
    return np.exp(error * error * np.float32(-1.0 / variance))


def vertical_velocity(state: LocomotionState) -> Array:
    """Square of the base's velocity along its own z [(m/s)^2]."""
    return np.square(state.base_linear_velocity[:, 2])


def roll_pitch_rate(state: LocomotionState) -> Array:
    """Square of the base's angular velocity about x and y [(rad/s)^2]."""
    return np.square(state.base_angular_velocity[:, 0]) + np.square(state.base_angular_velocity[:, 1])


def orientation(state: LocomotionState) -> Array:
    """Square of the sine of the tilt."""
    return np.square(state.projected_gravity[:, 0]) + np.square(state.projected_gravity[:, 1])


def base_height(state: LocomotionState, target: float = 0.48) -> Array:
    """Square of the distance from the wanted height [m^2]."""
    return np.square(state.base_height - np.float32(target))


def joint_torque(state: LocomotionState) -> Array:
    """Sum of squares [(N m)^2]."""
    return _square_sum(state.joint_torque)


def joint_acceleration(state: LocomotionState) -> Array:
    """Sum of squares [(rad/s^2)^2]."""
    return _square_sum(state.joint_acceleration)


def action_rate(state: LocomotionState) -> Array:
    """Sum of squares of how much actions changed."""
    return _square_sum(state.action_change)


def joint_deviation(state: LocomotionState) -> Array:
    """Sum of the distances of joints from their default angles [rad]."""
    return np.abs(state.joint_position).sum(axis=1)


def stand_still(state: LocomotionState, least: float = 0.1) -> Array:
    """`joint_deviation` where the commanded speed is at most `least` [m/s]."""
    return joint_deviation(state) * ~_is_moving(state.commands, least)


def feet_air_time(state: LocomotionState, wanted: float = 0.5, least: float = 0.1) -> Array:
    """At each touchdown how much longer than `wanted` [s] the swing was; zero where the commanded speed is at most `least` [m/s]."""
    longer = (state.foot_air_time.T - np.float32(wanted)) * state.foot_touchdown.T
    return longer.sum(axis=0) * _is_moving(state.commands, least)


def undesired_contacts(state: LocomotionState) -> Array:
    """Bodies other than feet that touch the ground."""
    return state.undesired_contacts


def alive(state: LocomotionState) -> Array:
    """One."""
    return np.ones_like(state.base_height)


def default_rewards() -> dict[str, tuple[float, Reward]]:
    """Terms and weights that Isaac Lab uses for ANYmal on flat ground."""
    return {
        "track_linear_velocity": (1.0, track_linear_velocity),
        "track_yaw_rate": (0.5, track_yaw_rate),
        "vertical_velocity": (-2.0, vertical_velocity),
        "roll_pitch_rate": (-0.05, roll_pitch_rate),
        "joint_torque": (-2.5e-5, joint_torque),
        "joint_acceleration": (-2.5e-7, joint_acceleration),
        "action_rate": (-0.01, action_rate),
        "feet_air_time": (0.5, feet_air_time),
        "undesired_contacts": (-1.0, undesired_contacts),
        "orientation": (-5.0, orientation),
    }
