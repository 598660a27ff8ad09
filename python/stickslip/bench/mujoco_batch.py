"""Many robots in MuJoCo through `mujoco.rollout`: elliptic cones and Newton, everything else as it comes."""

from __future__ import annotations

import mujoco
import numpy as np
from mujoco import rollout

from stickslip.bench.episodes import Clock, Plan, renew
from stickslip.bench.mjcf import joint_name, write_mjcf
from stickslip.bench.tasks import TICK, Array, Indices, Task

VERSION: str = mujoco.__version__

#: Steps of a call. Targets change within it, resets wait for its end: long calls cost MuJoCo the least.
CALL = 10 * TICK


class MujocoBatch:
    """Environments of a task, on one thread (the caller's) or several."""

    def __init__(self, task: Task, envs: int, threads: int):
        self._task = task
        self.envs, self.threads = envs, threads
        self._model = compile_task(task)
        self._data = [mujoco.MjData(self._model) for _ in range(threads)]
        self._rollout = rollout.Rollout(nthread=threads if threads > 1 else 0)
        self._state = np.zeros((envs, 1 + task.model.nq + task.model.nu))  # time, qpos, qvel
        self._states = np.zeros((envs, CALL, self._state.shape[1]))
        self._held = np.zeros((envs, CALL, task.model.num_joints))

    def close(self) -> None:
        """Ends its threads."""
        self._rollout.close()

    @property
    def finite(self) -> bool:
        """Whether no state has overflowed."""
        return bool(np.isfinite(self._state).all())

    def place(self, envs: Indices, q: Array, u: Array, targets: Array) -> None:
        """Puts environments into states of the Model's conventions; targets (k, joints) to hold."""
        nq = self._task.model.nq
        self._state[envs, 0] = 0
        self._state[envs, 1 : 1 + nq] = q
        self._state[envs, 1 + nq :] = to_mujoco(self._task, q, u)
        self._held[envs] = targets[:, None]

    def controls(self, laid_out: Plan) -> Array | None:
        """Those of the plan, one per step; not timed."""
        if laid_out.targets is None:
            return None
        return np.repeat(laid_out.targets[: CALL // TICK].swapaxes(0, 1), TICK, axis=1).astype(np.float64)

    def run(self, clock: Clock, laid_out: Plan, controls: Array | None) -> None:
        """Takes CALL steps."""
        over = np.flatnonzero(clock.over())
        if len(over):
            clock.begin(over)
            renew(clock, laid_out, over)
            self.place(over, laid_out.q[over], laid_out.u[over], laid_out.first_targets[over])
        control = self._held if controls is None else controls
        self._rollout.rollout(
            self._model,
            self._data,
            self._state,
            control if self._task.actuated else None,
            nstep=CALL,
            state=self._states,
        )
        np.copyto(self._state, self._states[:, -1])
        clock.age += CALL
        if self._task.ends_when_still:
            for k in range(TICK - 1, CALL, TICK):
                clock.look(self._states[:, k, 1 + self._task.model.nq :])


def compile_task(task: Task) -> mujoco.MjModel:
    """The task's robot, its tree checked against the Model's."""
    m = mujoco.MjModel.from_xml_string(write_mjcf(task))
    first = task.model.nu - task.model.num_joints
    order = [m.joint(joint_name(j)).dofadr[0] - first for j in range(task.model.num_joints)]
    if (m.nq, m.nv, order) != (task.model.nq, task.model.nu, list(range(task.model.num_joints))):
        raise RuntimeError("MuJoCo sees another tree than Model")
    if mujoco.mj_stateSize(m, mujoco.mjtState.mjSTATE_FULLPHYSICS) != 1 + m.nq + m.nv:
        raise RuntimeError("the state of this version of MuJoCo is not time, qpos, qvel")
    if not task.actuated:
        m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    return m


def to_mujoco(task: Task, q: Array, u: Array) -> Array:
    """Velocities (n, nu) as MuJoCo has them: the angular velocity of a free joint is in body axes there."""
    out = np.array(u, np.float64)
    if task.model.base == "floating":
        w, v = q[:, 3:4], q[:, 4:7]
        rate = u[:, 3:6]
        t = 2 * np.cross(rate, v)  # R^T rate, by the conjugate quaternion
        out[:, 3:6] = rate + w * t + np.cross(t, v)
    return out
