"""ANYmal as primitives for `render`, with arrows for contact forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.paper.render import Camera, RoundCone, rounded_box
from stickslip.scenes import Scene

Array = NDArray[np.float64]

_SHELL = (0.80, 0.16, 0.13)
_DARK = (0.17, 0.18, 0.20)
_LINK = (0.74, 0.76, 0.79)
_RUBBER = (0.10, 0.10, 0.11)
_FORCE = (0.05, 0.45, 0.80)
_METERS_PER_NEWTON = 0.6 / 300  # an arrow as long as this for the robot's weight
_LONGEST = 0.75  # [m]
_FOOT_RADIUS = 0.031
_FOOT_OFFSET = np.array([0, 0, 0.02325])  # of the sphere, in the frame of the foot


def robot_parts(scene: Scene) -> list:
    """Torso, legs and feet at the present state."""
    robot = scene.robot
    q = robot.q
    base, turn = q[:3], _rotation(q[3:7])
    at = lambda v: base + turn @ np.asarray(v, dtype=float)  # noqa: E731
    parts = rounded_box(at([0, 0, 0.08]), turn, np.array([0.2655, 0.125, 0.085]), 0.045, _SHELL)
    parts += rounded_box(at([0, 0, 0.00]), turn, np.array([0.235, 0.09, 0.05]), 0.03, _DARK)
    parts.append(RoundCone(at([0.262, -0.06, 0.085]), at([0.262, 0.06, 0.085]), 0.026, 0.026, _RUBBER))
    parts.append(RoundCone(at([0.15, 0, 0.17]), at([0.15, 0, 0.20]), 0.042, 0.036, _DARK))
    for y in (-0.075, 0.075):  # the handles
        parts.append(RoundCone(at([-0.18, y, 0.178]), at([0.04, y, 0.178]), 0.009, 0.009, _DARK))
    for leg in ("LF", "LH", "RF", "RH"):
        parts += _leg_parts(robot, leg, at)
    return parts


def _leg_parts(robot, leg: str, at) -> list:
    side, fore = (1 if leg[0] == "L" else -1), (1 if leg[1] == "F" else -1)
    pose = {name: robot.frame_pose(f"{leg}_{name}") for name in ("HIP", "THIGH", "SHANK", "FOOT")}

    def on(name: str, x: float, y: float, z: float) -> Array:
        return pose[name].position + pose[name].rotation @ np.array([fore * x, side * y, z])

    foot = on("FOOT", *(_FOOT_OFFSET * [fore, side, 1]))
    return [
        RoundCone(at([fore * 0.19, side * 0.105, 0]), on("HIP", 0.01, 0, 0), 0.047, 0.047, _DARK),
        RoundCone(on("HIP", 0.02, 0, 0), on("THIGH", 0, 0.0, 0), 0.042, 0.045, _LINK),
        RoundCone(on("THIGH", 0, -0.01, 0), on("THIGH", 0, 0.085, 0), 0.052, 0.052, _DARK),
        RoundCone(on("THIGH", 0, 0.085, -0.02), on("SHANK", 0, -0.02, 0), 0.044, 0.034, _LINK),
        RoundCone(on("SHANK", 0, -0.045, 0), on("SHANK", 0, 0.015, 0), 0.040, 0.040, _DARK),
        RoundCone(on("SHANK", 0, -0.01, -0.01), foot + 0.02 * _unit(on("SHANK", 0, 0, 0) - foot), 0.031, 0.016, _LINK),
        RoundCone(foot, foot, _FOOT_RADIUS, _FOOT_RADIUS, _RUBBER),
    ]


def force_parts(scene: Scene) -> list:
    """An arrow per contact that pushes, along the contact force on the robot."""
    parts = []
    duration = scene.world.time_step / max(scene.robot.solve_info.substeps, 1)
    for contact in scene.robot.contacts:
        force = contact.impulse / duration
        size = float(np.linalg.norm(force))
        if size < 10:
            continue
        along, length = force / size, min(size * _METERS_PER_NEWTON, _LONGEST)
        head = min(0.11, 0.6 * length)
        start = contact.position
        neck = start + along * (length - head)
        parts.append(RoundCone(start, neck, 0.011, 0.011, _FORCE, 0.55))
        parts.append(RoundCone(neck, start + along * length, 0.030, 0.002, _FORCE, 0.55))
    return parts


@dataclass(frozen=True)
class Shot:
    """What a camera sees at one moment."""

    parts: list
    camera: Camera
    floor_opacity: float = 1.0

    @classmethod
    def of(
        cls,
        scene: Scene,
        *,
        distance: float = 3.0,
        azimuth: float = -52,
        elevation: float = 13,
        look_up: float = 0.42,
        floor_opacity: float = 1.0,
    ) -> Shot:
        """The scene now, from `distance` [m] and two angles [degree], the camera above the same point as the base."""
        q = scene.robot.q
        target = np.array([q[0], q[1], look_up])
        a, e = np.radians(azimuth), np.radians(elevation)
        eye = target + distance * np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])
        return cls(robot_parts(scene) + force_parts(scene), Camera(eye, target), floor_opacity)


def _rotation(quaternion: Array) -> Array:
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _unit(v: Array) -> Array:
    return v / max(float(np.linalg.norm(v)), 1e-12)
