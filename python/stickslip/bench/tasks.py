"""What robots do while they are timed: episodes as pure functions of their number, for any engine."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stickslip import _core, assets
from stickslip._core import Model
from stickslip.world import Robot, World

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

#: Time step of all tasks [s].
TIME_STEP = 1e-3
#: Targets change and episodes end at multiples of so many steps.
TICK = 10

#: The tasks with ANYmal, and what `stickslip.scenes` calls them.
TASKS = {"stand": "stand", "trot": "open_loop_trot", "hang": "hang", "drop": "drop", "random": "random"}


@dataclass(frozen=True)
class Task:
    """Episodes of one robot, held by PD control or left alone."""

    name: str
    model: Model
    ground: bool
    kp: Array  #: (joints,) [N m/rad or N/m]; kp and kd all zero: unactuated
    kd: Array  #: (joints,) [N m s/rad or N s/m]
    episode_steps: int
    hold_steps: int  #: steps between targets; 0: the first one holds for the episode
    ends_when_still: bool  #: reset, too, when every |u| stayed below 0.05 for 0.2 s
    initial_states: Callable[[Indices], tuple[Array, Array]]  #: episodes (n,) -> q (n, nq), u (n, nu)
    targets: Callable[[Indices, Indices], Array]  #: episodes (n,), number of the target in it (n,) -> (n, joints)

    @property
    def actuated(self) -> bool:
        """Whether there is any PD control."""
        return bool(self.kp.any() or self.kd.any())

    def world(self, integrator: str) -> World:
        """A new world with the robot, and the ground where the task has one."""
        world = World(TIME_STEP, integrator=integrator)
        if self.ground:
            world.add_ground()
        world.add_robot(self.model).set_pd_gains(self.kp, self.kd)
        return world


def anymal_task(name: str) -> Task:
    """One of `TASKS` on ANYmal B, the same episodes as in benchmarks/compare. ValueError lists them."""
    if name not in TASKS:
        raise ValueError(f"task is {name!r}; choose one of {', '.join(TASKS)}")
    spec = _core.scenes.task_spec(TASKS[name])
    model = _core.scenes.task_model(TASKS[name], _core.load_urdf(assets.path("anymal_b")))
    return Task(
        name=name,
        model=model,
        ground=True,
        kp=np.full(model.num_joints, spec.kp),
        kd=np.full(model.num_joints, spec.kd),
        episode_steps=round(spec.episode / TIME_STEP),
        hold_steps=TICK if spec.moving_targets else 0,
        ends_when_still=spec.ends_when_still,
        initial_states=lambda episodes: _core.scenes.initial_states(TASKS[name], episodes),
        targets=lambda episodes, numbers: _core.scenes.pd_targets(TASKS[name], episodes, numbers),
    )


# Any robot: a stiff PD control that MuJoCo's explicit one can follow, too.
_EPISODE = 2.0  # [s]
_HOLD = 0.5  # of a fixed base, between targets [s]
_SPREAD = 0.5  # of these targets [rad or m]
_START_SPREAD = 0.02  # of the joints at the start [rad or m]
_DROP = 0.02  # of a floating base, onto the ground [m]
_RATE = 150.0  # kp over the inertia that a joint sees, square root [rad/s]
_DAMPING = 0.01  # kd over kp [s]


def urdf_task(path: str | os.PathLike[str], base: str = "floating") -> Task:
    """A robot of a URDF file. Floating base: dropped 2 cm, held in its zero posture. Fixed: swings to random targets every 0.5 s.

    OSError or ValueError says what is wrong with the file.
    """
    model = _core.load_urdf(Path(path), base)
    posture = np.clip(0.0, model.lower, model.upper) + np.zeros(model.num_joints)
    ruler = World(TIME_STEP)
    robot = ruler.add_robot(model)
    q = robot.q.copy()
    q[len(q) - len(posture) :] = posture
    robot.set_state(q, np.zeros(model.nu))
    kp = _RATE**2 * _inertias(robot)
    floating = base == "floating"

    def initial_states(episodes: Indices) -> tuple[Array, Array]:
        return np.stack([_start(robot, q, posture, int(e)) for e in episodes]), np.zeros((len(episodes), model.nu))

    def targets(episodes: Indices, numbers: Indices) -> Array:
        rows = np.tile(posture, (len(episodes), 1))
        if not floating:
            for row, key in zip(rows, zip(episodes.tolist(), numbers.tolist(), strict=True), strict=True):
                row += _SPREAD * np.random.default_rng(key).standard_normal(len(row))
        return np.clip(rows, model.lower, model.upper)

    return Task(
        name=Path(path).stem,
        model=model,
        ground=floating,
        kp=kp,
        kd=_DAMPING * kp,
        episode_steps=round(_EPISODE / TIME_STEP),
        hold_steps=0 if floating else round(_HOLD / TIME_STEP),
        ends_when_still=False,
        initial_states=initial_states,
        targets=targets,
    )


def _inertias(robot: Robot) -> Array:
    """(joints,) 1 / (M^-1)_jj: what each joint has to accelerate when the others are left alone."""
    first = robot.nu - robot.num_joints
    rest = robot.forward_dynamics(np.zeros(robot.nu))
    unit = np.eye(robot.nu)
    return np.array([1 / (robot.forward_dynamics(unit[j]) - rest)[j] for j in range(first, robot.nu)])


def _start(robot: Robot, q: Array, posture: Array, episode: int) -> Array:
    """A posture near the given one; a floating base so high that its lowest shape is 2 cm above the ground."""
    start = q.copy()
    first = len(q) - len(posture)
    spread = _START_SPREAD * np.random.default_rng(episode).standard_normal(len(posture))
    start[first:] = np.clip(posture + spread, robot.model.lower, robot.model.upper)
    if first:
        robot.set_state(start, np.zeros(robot.nu))
        lowest = _lowest_point(robot)
        start[2] += _DROP - lowest if np.isfinite(lowest) else 0.0
    return start


def _lowest_point(robot: Robot) -> float:
    """Of all shapes but meshes [m]; infinite if there are none."""
    names, lowest = robot.model.body_names, np.inf
    for shape in robot.model.shapes:
        if shape.type == "mesh":
            continue
        body = robot.frame_pose(names[shape.body])
        up = (body.rotation @ shape.pose.rotation)[2]  # world's z in the axes of the shape
        z = body.position[2] + body.rotation[2] @ shape.pose.position
        lowest = min(lowest, z - _reach(shape.type, shape.size, up))
    return lowest


def _reach(kind: str, size: Array, up: Array) -> float:
    """How far a shape reaches below its center [m]."""
    if kind == "sphere":
        return size[0]
    if kind == "box":
        return 0.5 * np.abs(up) @ size
    along = 0.5 * abs(up[2]) * size[1]
    return along + (size[0] if kind == "capsule" else size[0] * np.hypot(up[0], up[1]))
