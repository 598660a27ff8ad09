"""What ends an episode of a legged robot: each a function of a `LocomotionState` that returns a mask (num_envs,).

Time limits and states that are not finite are the task's own business.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stickslip.envs.locomotion_state import LocomotionState, Mask

__all__ = ["base_contact", "default_terminations", "low_base", "tilt"]

Termination = Callable[[LocomotionState], Mask]


def base_contact(state: LocomotionState) -> Mask:
    """The base touches the ground."""
    return state.base_contact


def tilt(state: LocomotionState, largest: float = 1.0) -> Mask:
    """The base's z leans further than `largest` from the vertical [rad]."""
    return state.projected_gravity[:, 2] > np.float32(-np.cos(largest))


def low_base(state: LocomotionState, least: float = 0.25) -> Mask:
    """The base origin is lower than `least` [m]."""
    return state.base_height < least


def default_terminations() -> dict[str, Termination]:
    """Base contact, as legged_gym and Isaac Lab; tilt, because thighs and shanks of this model do not collide."""
    return {"base_contact": base_contact, "tilt": tilt}
