"""What a float64 `stickslip.Batch` must do, made of one World per environment: the same names, the same semantics, slow."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np

import stickslip as ss
from stickslip.batch import ContactPoint
from stickslip.reports import StageTimes

STATE = ("q", "u", "time")
INPUTS = ("generalized_force", "pd_target")
OUTPUTS = ("contact_impulse", "contact_active", "status", "residual")
PARAMETERS = ("kp", "kd", "friction")
POINTS = {"sphere": 1, "capsule": 2, "box": 8, "cylinder": 8, "mesh": 0}


class BatchOfWorlds:
    """make_world: returns a new world with one robot, the same each time, with the ground of material "default".

    friction: of all shapes with the ground, as `make_world` sets it. Shapes may have frictions of their own only where they
    have materials of their own; restitution is lost where friction is assigned.
    """

    def __init__(self, make_world: Callable[[], ss.World], num_envs: int, friction: float = 0.8):
        self._worlds = [make_world() for _ in range(num_envs)]
        self._robots = [world.robots[0] for world in self._worlds]
        robot = self._robots[0]
        self.model, self.num_envs, self.dtype = robot.model, num_envs, np.dtype(np.float64)
        self.num_threads, self.instruction_set, self.width = 1, "none", 1
        self.time_step = self._worlds[0].time_step
        self._touching = [shape for shape in self.model.shapes if POINTS[shape.type]]
        self.contact_shapes = [shape.name for shape in self._touching]
        bodies = self.model.body_names
        self.contact_points = [
            ContactPoint(bodies[shape.body], shape.name, point)
            for shape in self._touching
            for point in range(POINTS[shape.type])
        ]
        self._initial = (robot.q, robot.u)
        self._arrays = self._make_arrays(friction)
        self._applied = self.friction.copy()
        self.memory_bytes = sum(array.nbytes for array in self._arrays.values())

    def _make_arrays(self, friction: float) -> dict[str, np.ndarray]:
        robot, n, points = self._robots[0], self.num_envs, len(self.contact_points)
        kp, kd = robot.pd_gains
        rows = {
            "q": robot.q,
            "u": robot.u,
            "time": np.zeros(()),
            "generalized_force": robot.generalized_force,
            "pd_target": robot.pd_target,
            "contact_impulse": np.zeros((points, 3)),
            "contact_active": np.zeros(points, bool),
            "status": np.zeros((), np.uint32),
            "residual": np.zeros(()),
            "kp": kp,
            "kd": kd,
            "friction": np.full(len(self.contact_shapes), friction),
        }
        return {name: np.tile(row, (n,) + (1,) * row.ndim).reshape(n, *row.shape) for name, row in rows.items()}

    # Running

    def step(self, steps: int = 1) -> ss.StepStatus:
        for env in range(self.num_envs):
            self.status[env] = self.residual[env] = 0
            if steps > 0:
                self._step(env, steps)
        return ss.StepStatus(int(np.bitwise_or.reduce(self.status)))

    def _step(self, env: int, steps: int) -> None:
        world, robot = self._worlds[env], self._robots[env]
        if not all(np.isfinite(self._arrays[name][env]).all() for name in ("q", "u", *INPUTS, *PARAMETERS)):
            self.status[env] |= ss.StepStatus.NON_FINITE
        else:
            self._write(env)
            for _ in range(steps):
                try:
                    self.status[env] |= world.step()
                except ss.StepError:
                    self.status[env] |= ss.StepStatus.NON_FINITE
                    break
                self.time[env] += self.time_step
                self.residual[env] = max(self.residual[env], robot.solve_info.residual)
        self._read(env)

    def _write(self, env: int) -> None:
        """Into the world, what was written into the arrays."""
        robot = self._robots[env]
        if (robot.q.tobytes(), robot.u.tobytes()) != (self.q[env].tobytes(), self.u[env].tobytes()):
            robot.set_state(self.q[env], self.u[env])
        robot.set_pd_gains(self.kp[env], self.kd[env])
        robot.pd_target = self.pd_target[env]
        robot.generalized_force = self.generalized_force[env]
        if (self.friction[env] != self._applied[env]).any():
            self._write_friction(env)

    def _write_friction(self, env: int) -> None:
        by_material: dict[str, float] = {}
        for shape, friction in zip(self._touching, self.friction[env].tolist(), strict=True):
            if by_material.setdefault(shape.material or "default", friction) != friction:
                raise NotImplementedError(f"shapes of material {shape.material!r} with different friction")
        for material, friction in by_material.items():
            self._worlds[env].set_material_pair(material, "default", friction=friction)
        self._applied[env] = self.friction[env]

    def _read(self, env: int) -> None:
        """From the world, what a step changes."""
        robot = self._robots[env]
        self.q[env], self.u[env] = robot.q, robot.u
        self.contact_active[env] = False
        self.contact_impulse[env] = 0
        for contact in robot.contacts:
            column = self.contact_points.index(ContactPoint(contact.body, contact.shape, contact.point))
            self.contact_active[env, column] = True
            self.contact_impulse[env, column] = contact.impulse

    def flagged(self, status: ss.StepStatus) -> np.ndarray:
        return np.flatnonzero(self.status & np.uint32(status))

    def reset(self, where: Any = None, q: Any = None, u: Any = None) -> None:
        envs = np.arange(self.num_envs) if where is None else np.asarray(where)
        envs = np.flatnonzero(envs) if envs.dtype == bool else envs
        q = np.broadcast_to(self._initial[0] if q is None else q, (len(envs), self.model.nq))
        u = np.broadcast_to(self._initial[1] if u is None else u, (len(envs), self.model.nu))
        for row, env in enumerate(envs):
            self._robots[env].set_state(q[row], u[row])
            self._read(env)
            self.time[env] = self.status[env] = self.residual[env] = 0

    def save_state(self) -> bytes:
        arrays = {name: self._arrays[name].copy() for name in (*STATE, *OUTPUTS)}
        return pickle.dumps((arrays, [world.save_state() for world in self._worlds]))

    def load_state(self, blob: bytes) -> None:
        arrays, worlds = pickle.loads(blob)
        for world, state in zip(self._worlds, worlds, strict=True):
            world.load_state(state)
        for name, array in arrays.items():
            self._arrays[name][:] = array

    def set_profiling(self, on: bool) -> None:
        for world in self._worlds:
            world.set_profiling(on)

    @property
    def stage_times(self) -> StageTimes:
        fields = StageTimes.__dataclass_fields__
        return StageTimes(*(sum(getattr(world.stage_times, name) for world in self._worlds) for name in fields))

    def reset_stage_times(self) -> None:
        for world in self._worlds:
            world.reset_stage_times()


def _array(name: str) -> property:
    def read(self: BatchOfWorlds) -> np.ndarray:
        return self._arrays[name]

    def write(self: BatchOfWorlds, value: Any) -> None:
        self._arrays[name][:] = value

    return property(read, None if name in (*OUTPUTS, "time") else write)


def _missing(name: str) -> property:
    def refuse(self: BatchOfWorlds, value: Any = None) -> None:
        raise NotImplementedError(f"{name}: a World cannot change it")

    return property(refuse, refuse)


for _name in (*STATE, *INPUTS, *OUTPUTS, *PARAMETERS):
    setattr(BatchOfWorlds, _name, _array(_name))
for _name in ("gravity", "body_mass", "body_com", "body_inertia", "external_wrench"):
    setattr(BatchOfWorlds, _name, _missing(_name))
