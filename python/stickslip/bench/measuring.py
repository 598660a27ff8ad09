"""Times a batch on a task, and MuJoCo in turns with it; then watches residuals and stages, untimed."""

from __future__ import annotations

import dataclasses
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip._arguments import count
from stickslip.batch import Batch
from stickslip.bench.episodes import Clock, drive, plan
from stickslip.bench.tasks import TICK, TIME_STEP, Task
from stickslip.reports import StepStatus

if TYPE_CHECKING:
    from stickslip.bench.mujoco_batch import MujocoBatch

ROUNDS = 5  #: counted ones; one more warms up
MUJOCO_ENVS = 64  #: at most, and 8 per thread: its speed does not depend on their number
QUANTILES = (0.5, 0.99, 0.9999, 1.0)
TOLERANCE = {"float32": 1e-5, "float64": 1e-8}  #: on the residual [m/s]

_POOL = 128  # environments that are brought into different phases; more start as copies of these
_WATCHED = 1_000_000  # robot-steps whose residuals are kept, about
_SCRIPT_BYTES = 64 << 20  # for targets laid out at once
_STAGES = ("dynamics", "detection", "delassus", "solve", "integrate")


@dataclass(frozen=True)
class Options:
    """What is measured. ValueError or TypeError names what is out of range."""

    envs: int = 1024
    threads: int = 0  #: 0: one per core that this process may use
    dtype: str = "float32"
    integrator: str = "energy_safe"
    steps: int = 2000  #: of every environment; rounded up to 5 rounds of 10 steps
    instruction_set: str | None = None
    mujoco: bool = True  #: beside it, if it is installed

    def __post_init__(self) -> None:
        count("threads", self.threads)
        for name in ("envs", "steps"):
            count(name, getattr(self, name), least=1)

    @property
    def steps_of_round(self) -> int:
        """A multiple of TICK."""
        return TICK * math.ceil(self.steps / (ROUNDS * TICK))


@dataclass(frozen=True)
class Speed:
    """One engine."""

    engine: str  #: "stickslip" or "MuJoCo <version>"
    threads: int
    envs: int
    us_per_round: list[float]  #: wall time per robot-step, one per counted round
    ratio: float | None = None  #: MuJoCo: its time over stickslip's, median over the rounds

    @property
    def us(self) -> float:
        """Wall time per robot-step, median [us]."""
        return statistics.median(self.us_per_round)

    @property
    def robot_steps_per_s(self) -> float:
        """All environments together."""
        return 1e6 / self.us

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds of all environments per second."""
        return TIME_STEP * self.robot_steps_per_s


@dataclass(frozen=True)
class Watched:
    """What single steps reported."""

    robot_steps: int
    residual_quantiles: dict[str, float]  #: [m/s]
    tolerance: float  #: on the residual [m/s]
    above_tolerance: int  #: robot-steps
    above_unflagged: int  #: of these, such whose status does not say so
    not_converged: int  #: robot-steps with this status
    non_finite: int  #: robot-steps with this status
    contacts: float  #: in the solve, mean per robot-step


@dataclass(frozen=True)
class Result:
    """A batch on a task."""

    task: str
    dofs: int
    dtype: str
    integrator: str
    instruction_set: str
    width: int  #: lanes of a pack
    memory_bytes: int  #: held by the batch
    speed: Speed
    mujoco: list[Speed]
    stages_us: dict[str, float]  #: thread time per robot-step [us]
    watched: Watched

    @property
    def faults(self) -> list[str]:
        """Why the result does not count; empty: it does."""
        w = self.watched
        found = [f"{w.non_finite} robot-steps were not finite"] if w.non_finite else []
        if w.above_unflagged:
            found.append(
                f"{w.above_unflagged} robot-steps have a residual above {w.tolerance:g} m/s and were not flagged"
            )
        return found

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        out = dataclasses.asdict(self)
        for speed, entry in ((self.speed, out["speed"]), *zip(self.mujoco, out["mujoco"], strict=True)):
            entry |= {
                "us_per_robot_step": speed.us,
                "robot_steps_per_s": speed.robot_steps_per_s,
                "real_time_factor": speed.real_time_factor,
            }
        return out | {"faults": self.faults}


def measure(task: Task, options: Options = Options(), say: Callable[[str], object] = lambda _: None) -> Result:
    """Runs a batch on a task. say: is called with what is being done.

    ValueError where there cannot be such a batch: an instruction set that the machine lacks, a robot that a batch cannot hold.
    """
    batch = _make(task, options, options.envs)
    say("bringing robots into different phases")
    clock, q, u = _stagger(task, options, batch)
    rivals = [_Rival(task, clock, q, u, threads) for threads in _rival_threads(batch, options)]
    try:
        us = _race(batch, clock, rivals, options, say)
    finally:
        for rival in rivals:
            rival.engine.close()
    say("watching residuals")
    watched = _watch(batch, clock, options)
    say("timing stages")
    stages = _stages(batch, clock, options)
    return Result(
        task=task.name,
        dofs=task.model.nu,
        dtype=options.dtype,
        integrator=options.integrator,
        instruction_set=batch.instruction_set,
        width=batch.width,
        memory_bytes=batch.memory_bytes,
        speed=Speed("stickslip", batch.num_threads, options.envs, us),
        mujoco=[rival.speed(us) for rival in rivals],
        stages_us=stages,
        watched=watched,
    )


def _make(task: Task, options: Options, envs: int) -> Batch:
    world = task.world(options.integrator)
    return Batch(world, envs, options.dtype, options.threads, instruction_set=options.instruction_set)


def _stagger(task: Task, options: Options, batch: Batch) -> tuple[Clock, np.ndarray, np.ndarray]:
    """Runs one episode's length, so that all phases are there; returns clock and states of the pool that did."""
    envs = min(options.envs, _POOL)
    pool = batch if envs == options.envs else _make(task, options, envs)
    clock = Clock(task, envs)
    _run(pool, clock, task.episode_steps)
    q, u = pool.q.astype(np.float64), pool.u.astype(np.float64)
    if pool is batch:
        return clock, q, u
    rows = np.arange(options.envs) % envs
    batch.reset(None, q[rows], u[rows])
    spread = clock.spread(options.envs)
    if not task.hold_steps:
        batch.pd_target = task.targets(spread.episode, np.zeros(options.envs, np.int64))
    return spread, q[rows], u[rows]


def _run(batch: Batch, clock: Clock, steps: int, step: Callable[[int], object] | None = None) -> float:
    """Takes `steps`; returns the seconds that it took, without laying out the targets."""
    row = batch.num_envs * max(1, clock.task.model.num_joints) * batch.dtype.itemsize
    at_once = TICK * max(1, _SCRIPT_BYTES // row)
    seconds = 0.0
    for first in range(0, steps, at_once):
        n = min(at_once, steps - first)
        laid_out = plan(clock, n, batch.dtype)
        start = time.perf_counter()
        drive(batch, clock, laid_out, n, step)
        seconds += time.perf_counter() - start
    return seconds


class _Rival:
    """MuJoCo, begun in the states of some environments of the batch."""

    def __init__(self, task: Task, clock: Clock, q: np.ndarray, u: np.ndarray, threads: int):
        from stickslip.bench import mujoco_batch

        self.version = mujoco_batch.VERSION
        envs = min(clock.envs, max(MUJOCO_ENVS, 8 * threads))
        self.engine: MujocoBatch = mujoco_batch.MujocoBatch(task, envs, threads)
        self.clock = clock.spread(envs, mujoco_batch.CALL)
        everybody = np.arange(envs)
        targets = task.targets(everybody, np.zeros(envs, np.int64))
        self.engine.place(everybody, q[:envs], u[:envs], targets)
        self.call = mujoco_batch.CALL
        self.us: list[float] = []

    def round(self) -> None:
        """One timed call."""
        laid_out = plan(self.clock, self.call, np.dtype(np.float64))
        controls = self.engine.controls(laid_out)
        start = time.perf_counter()
        self.engine.run(self.clock, laid_out, controls)
        self.us.append(1e6 * (time.perf_counter() - start) / (self.engine.envs * self.call))
        if not self.engine.finite:
            raise RuntimeError("MuJoCo's states are not finite any more")

    def speed(self, ours: list[float]) -> Speed:
        theirs = self.us[-len(ours) :]
        ratio = statistics.median(a / b for a, b in zip(theirs, ours, strict=True))
        return Speed(f"MuJoCo {self.version}", self.engine.threads, self.engine.envs, theirs, ratio)


def _rival_threads(batch: Batch, options: Options) -> list[int]:
    """One thread, and as many as the batch has; none without MuJoCo."""
    if not options.mujoco or not mujoco_is_installed():
        return []
    return sorted({1, batch.num_threads})


def mujoco_is_installed() -> bool:
    """Whether `mujoco` with its `rollout` can be imported."""
    try:
        import mujoco.rollout  # noqa: F401
    except ImportError:
        return False
    return True


def _race(
    batch: Batch, clock: Clock, rivals: list[_Rival], options: Options, say: Callable[[str], object]
) -> list[float]:
    us = []
    for k in range(ROUNDS + 1):  # the first warms up
        say(f"timing, round {k} of {ROUNDS}")
        us.append(1e6 * _run(batch, clock, options.steps_of_round) / (options.steps_of_round * batch.num_envs))
        for rival in rivals:
            rival.round()
    return us[1:]


def _watch(batch: Batch, clock: Clock, options: Options) -> Watched:
    """Steps one by one and looks at each."""
    wanted = TICK * max(1, math.ceil(min(options.steps, _WATCHED / batch.num_envs) / TICK))
    residuals = np.zeros((wanted, batch.num_envs), batch.dtype)
    status = np.zeros((wanted, batch.num_envs), np.uint32)
    done, contacts = 0, 0

    def step(n: int) -> None:
        nonlocal done, contacts
        for _ in range(n):
            batch.step()
            residuals[done], status[done] = batch.residual, batch.status
            contacts += np.count_nonzero(batch.contact_active)
            done += 1

    _run(batch, clock, wanted, step)
    tolerance = TOLERANCE[options.dtype]
    not_converged = (status & StepStatus.NOT_CONVERGED) != 0
    above = ~(residuals <= tolerance)
    values = np.quantile(residuals.astype(np.float64), QUANTILES, method="inverted_cdf")
    return Watched(
        robot_steps=residuals.size,
        residual_quantiles={f"{q:g}": float(v) for q, v in zip(QUANTILES, values, strict=True)},
        tolerance=tolerance,
        above_tolerance=int(above.sum()),
        above_unflagged=int((above & ~not_converged).sum()),
        not_converged=int(not_converged.sum()),
        non_finite=int(((status & StepStatus.NON_FINITE) != 0).sum()),
        contacts=contacts / residuals.size,
    )


def _stages(batch: Batch, clock: Clock, options: Options) -> dict[str, float]:
    batch.set_profiling(True)
    batch.reset_stage_times()
    _run(batch, clock, options.steps_of_round)
    batch.set_profiling(False)
    times = batch.stage_times
    return {name: 1e6 * getattr(times, name) / max(1, times.steps) for name in _STAGES}
