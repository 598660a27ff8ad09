"""What the observations, rewards and terminations of a legged robot read: measured once per control step for the whole batch.

Small arrays are kept component by component in memory and shown as (num_envs, 3): a column of them is contiguous, and NumPy is
several times faster on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.envs.streams import Envs

__all__ = ["ContactColumns", "LocomotionState"]

Array = NDArray[np.float32]
Mask = NDArray[np.bool_]

MEASURED = (
    "base_height",
    "base_linear_velocity",
    "base_angular_velocity",
    "projected_gravity",
    "joint_position",
    "joint_velocity",
)


@dataclass(frozen=True)
class ContactColumns:
    """Which contact points belong to what, and from which impulse on one counts as a contact."""

    feet: list[list[int]]  #: points of each foot
    others: list[list[int]]  #: points of each body that is neither a foot nor without points; the base comes first
    threshold: float  #: vertical impulse in a physics step [N s]


@dataclass
class LocomotionState:
    """Rows are environments. Vectors are in base axes; `projected_gravity` is the unit vector of gravity there."""

    base_height: Array  #: (n,) of the base origin above z = 0 [m]
    base_linear_velocity: Array  #: (n, 3) of the base origin [m/s]
    base_angular_velocity: Array  #: (n, 3) [rad/s]
    projected_gravity: Array  #: (n, 3)
    joint_position: Array  #: (n, joints) offset from the default angles [rad]
    joint_velocity: Array  #: (n, joints) [rad/s]
    previous_joint_velocity: Array  #: (n, joints) one control step ago [rad/s]
    joint_target: Array  #: (n, joints) offset of the PD target from the default angles [rad]
    actions: Array  #: (n, actions) as the policy gave them, clipped
    previous_actions: Array  #: (n, actions)
    commands: Array  #: (n, 3) wanted velocity: forward, left [m/s], yaw rate [rad/s]
    foot_contact: Mask  #: (n, feet) at the end of the control step
    foot_touchdown: Mask  #: (n, feet) which touch the ground again in this control step
    foot_air_time: Array  #: (n, feet) since the foot left the ground; at touchdown that of the whole swing [s]
    base_contact: Mask  #: (n,)
    undesired_contacts: Array  #: (n,) bodies other than feet that touch the ground
    step_seconds: float  #: control step [s]
    kp: float | NDArray[Any]  #: PD gains, (n, joints) where they differ [N m/rad]
    kd: float | NDArray[Any]  #: [N m s/rad]

    @classmethod
    def zeros(cls, num_envs: int, joints: int, feet: int, **constants: float) -> LocomotionState:
        """Of a robot that hangs still at height zero."""

        def columns(n: int, dtype: type = np.float32) -> NDArray[Any]:
            return np.zeros((n, num_envs), dtype).T

        def rows(n: int) -> Array:
            return np.zeros((num_envs, n), np.float32)

        return cls(
            base_height=np.zeros(num_envs, np.float32),
            base_linear_velocity=columns(3),
            base_angular_velocity=columns(3),
            projected_gravity=columns(3),
            joint_position=rows(joints),
            joint_velocity=rows(joints),
            previous_joint_velocity=rows(joints),
            joint_target=rows(joints),
            actions=rows(joints),
            previous_actions=rows(joints),
            commands=columns(3),
            foot_contact=columns(feet, np.bool_),
            foot_touchdown=columns(feet, np.bool_),
            foot_air_time=columns(feet),
            base_contact=np.zeros(num_envs, np.bool_),
            undesired_contacts=np.zeros(num_envs, np.float32),
            **constants,
        )

    # Derived on demand: only rewards ask for them

    @property
    def joint_torque(self) -> Array:
        """(n, joints) of the PD control, at the end of the control step [N m]."""
        torque = self.joint_target - self.joint_position
        torque *= np.asarray(self.kp, np.float32)
        torque -= np.asarray(self.kd, np.float32) * self.joint_velocity
        return torque

    @property
    def joint_acceleration(self) -> Array:
        """(n, joints) mean over the control step [rad/s^2]."""
        change = self.joint_velocity - self.previous_joint_velocity
        change *= np.float32(1.0 / self.step_seconds)
        return change

    @property
    def action_change(self) -> Array:
        """(n, actions) since the last control step."""
        return self.actions - self.previous_actions

    # Measuring

    def measure(self, q: NDArray[Any], u: NDArray[Any], default_angles: Array) -> None:
        """Base and joints at the states q (n, 7 + joints), u (n, 6 + joints) of `Batch`."""
        np.copyto(self.base_height, q[:, 2], casting="same_kind")
        np.subtract(q[:, 7:], default_angles, out=self.joint_position, casting="same_kind")
        np.copyto(self.joint_velocity, u[:, 6:], casting="same_kind")
        axes = _base_axes(np.array(q[:, 3:7].T, np.float32, order="C"))
        velocity = np.array(u[:, :6].T, np.float32, order="C")
        for row, axis in enumerate(axes):
            _dot(axis, velocity[:3], self.base_linear_velocity[:, row])
            _dot(axis, velocity[3:], self.base_angular_velocity[:, row])
            np.negative(axis[2], out=self.projected_gravity[:, row])

    def measure_contacts(self, impulse: NDArray[Any], columns: ContactColumns) -> None:
        """Contacts and air times after a control step, from the impulses (n, points, 3) of its last physics step."""
        self.foot_air_time *= ~self.foot_contact
        before = self.foot_contact.copy(order="K")
        touching = impulse[:, :, 2].T > columns.threshold  # (points, n)
        for foot, points in enumerate(columns.feet):
            np.logical_or.reduce(touching[points], axis=0, out=self.foot_contact[:, foot])
        np.logical_or.reduce(touching[columns.others[0]], axis=0, out=self.base_contact)
        self.undesired_contacts[:] = self.base_contact
        for points in columns.others[1:]:
            self.undesired_contacts += np.logical_or.reduce(touching[points], axis=0)
        # The landing of a foot that flickers for a step is no touchdown: it was not in the air.
        np.greater(self.foot_air_time, 0.0, out=self.foot_touchdown)
        self.foot_touchdown &= self.foot_contact & ~before
        self.foot_air_time += np.float32(self.step_seconds)

    def begin(self, envs: NDArray[np.int64]) -> None:
        """Forgets what the steps of an ended episode left."""
        for name in ("foot_contact", "foot_touchdown", "foot_air_time", "base_contact", "undesired_contacts"):
            getattr(self, name)[envs] = 0

    def rows(self, envs: Envs) -> LocomotionState:
        """A copy of some environments."""
        values = vars(self).items()
        return LocomotionState(**{name: v[envs] if isinstance(v, np.ndarray) else v for name, v in values})

    def set_measured(self, envs: NDArray[np.int64], rows: LocomotionState) -> None:
        """Puts back what `measure` wrote into such a copy."""
        for name in MEASURED:
            getattr(self, name)[envs] = getattr(rows, name)


def _base_axes(quaternion: Array) -> list[list[Array]]:
    """Base axes in world coordinates: entry [i][j] is component j of axis i, each (n,); quaternion (4, n) w x y z."""
    w, x, y, z = quaternion
    x2, y2, z2 = x + x, y + y, z + z
    xx, yy, zz = x * x2, y * y2, z * z2
    xy, xz, yz = x * y2, x * z2, y * z2
    wx, wy, wz = w * x2, w * y2, w * z2
    return [
        [1.0 - (yy + zz), xy + wz, xz - wy],
        [xy - wz, 1.0 - (xx + zz), yz + wx],
        [xz + wy, yz - wx, 1.0 - (xx + yy)],
    ]


def _dot(a: list[Array], b: Array, out: Array) -> None:
    """a . b of vectors (3, n), always summed in the same order: the bits do not depend on n."""
    np.multiply(a[0], b[0], out=out)
    out += a[1] * b[1]
    out += a[2] * b[2]
