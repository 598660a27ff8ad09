"""Environments in different phases of their episodes: when each is reset, and what its targets are."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.batch import Batch
from stickslip.bench.tasks import TICK, Array, Indices, Task

_STILL = 0.05  # [m/s, rad/s]
_STILL_TICKS = 20  # 0.2 s


class Clock:
    """Where every environment is in its episodes. Environment e runs the episodes e, e + envs, ...

    The first ones are cut short, so that after one episode's length of steps all phases are there.
    """

    def __init__(self, task: Task, envs: int):
        self.task = task
        self.envs = envs
        self.episode = np.arange(envs) - envs
        self.age = np.zeros(envs, np.int64)  #: steps since the episode began
        self.end = np.zeros(envs, np.int64)  #: its length
        self.still = np.zeros(envs, np.int64)  #: ticks for which every velocity was small

    def over(self) -> NDArray[np.bool_]:
        """Whose episode is over."""
        return (self.age >= self.end) | (self.still > _STILL_TICKS)

    def begin(self, envs: Indices) -> None:
        """The next episode of these environments."""
        self.episode[envs] += self.envs
        self.age[envs] = self.still[envs] = 0
        self.end[envs] = self.task.episode_steps
        first = envs[self.episode[envs] < self.envs]
        phase = self.episode[first] * _golden_stride(self.envs) % self.envs + 1
        ticks = self.task.episode_steps // TICK * phase // self.envs
        self.end[first] = TICK * np.maximum(1, ticks)

    def steps_to_event(self) -> int:
        """Steps until a target changes, an episode ends, or stillness is looked at."""
        if self.task.hold_steps or self.task.ends_when_still:
            return TICK
        return int((self.end - self.age).min())

    def look(self, u: Array) -> None:
        """Counts who is still; u (envs, nu) at a tick."""
        self.still = np.where(np.abs(u).max(axis=1, initial=0) < _STILL, self.still + 1, 0)

    def copy(self) -> Clock:
        """Goes on independently."""
        other = copy.copy(self)
        for name in ("episode", "age", "end", "still"):
            setattr(other, name, getattr(self, name).copy())
        return other

    def spread(self, envs: int, every: int = TICK) -> Clock:
        """The same phases for another number of environments, in turns; ages become multiples of `every` steps."""
        clock = Clock(self.task, envs)
        rows = np.arange(envs) % self.envs
        clock.episode = np.arange(envs)
        clock.age, clock.still = self.age[rows] // every * every, self.still[rows]
        clock.end = np.full(envs, self.task.episode_steps)
        return clock


def _golden_stride(n: int) -> int:
    """Coprime to n, and such that neighbors are in phases that lie far apart."""
    stride = max(1, int(0.618 * n))
    while math.gcd(stride, n) != 1:
        stride += 1
    return stride


@dataclass
class Plan:
    """Starts and targets of the coming steps, laid out before they are timed, as if a policy gave them."""

    episode: Indices  #: (envs,) whose start it is
    q: Array  #: (envs, nq)
    u: Array  #: (envs, nu)
    targets: Array | None  #: (ticks, envs, joints); None where they hold for an episode
    first_targets: Array  #: (envs, joints) of these episodes


def plan(clock: Clock, steps: int, dtype: np.dtype) -> Plan:
    """For `steps`, a multiple of TICK."""
    task = clock.task
    model, episode = task.model, clock.episode + clock.envs
    q, u = np.zeros((clock.envs, model.nq)), np.zeros((clock.envs, model.nu))
    first = np.zeros((clock.envs, model.num_joints), dtype)
    soon = np.flatnonzero(clock.over() | (clock.age + steps >= clock.end) | task.ends_when_still)
    if len(soon):
        q[soon], u[soon] = task.initial_states(episode[soon])
        first[soon] = task.targets(episode[soon], np.zeros(len(soon), np.int64))
    return Plan(episode, q, u, _moving_targets(clock, steps, dtype) if task.hold_steps else None, first)


def _moving_targets(clock: Clock, steps: int, dtype: np.dtype) -> Array:
    task, clock = clock.task, clock.copy()
    targets = np.empty((steps // TICK, clock.envs, task.model.num_joints), dtype)
    clock.begin(np.flatnonzero(clock.over()))
    row = task.targets(clock.episode, clock.age // task.hold_steps)
    for tick in range(len(targets)):
        clock.begin(np.flatnonzero(clock.over()))
        new = np.flatnonzero(clock.age % task.hold_steps == 0)
        if len(new):
            row[new] = task.targets(clock.episode[new], clock.age[new] // task.hold_steps)
        targets[tick] = row
        clock.age += TICK
    return targets


def drive(batch: Batch, clock: Clock, laid_out: Plan, steps: int, step: Callable[[int], object] | None = None) -> None:
    """Takes `steps` (a multiple of TICK): resets, targets, steps. step: what to call instead of `batch.step`."""
    task, step, done = clock.task, step or batch.step, 0
    while done < steps:
        over = np.flatnonzero(clock.over())
        if len(over):
            _reset(batch, clock, laid_out, over)
        if laid_out.targets is not None:
            np.copyto(batch.pd_target, laid_out.targets[done // TICK])
        n = min(steps - done, clock.steps_to_event())
        step(n)
        clock.age += n
        if task.ends_when_still:
            clock.look(batch.u)
        done += n


def _reset(batch: Batch, clock: Clock, laid_out: Plan, envs: Indices) -> None:
    clock.begin(envs)
    renew(clock, laid_out, envs)
    batch.reset(envs, laid_out.q[envs], laid_out.u[envs])
    if laid_out.targets is None:
        batch.pd_target[envs] = laid_out.first_targets[envs]


def renew(clock: Clock, laid_out: Plan, envs: Indices) -> None:
    """Brings the plan up to date for environments that began an episode which it does not hold: a second one in the same plan."""
    late = envs[laid_out.episode[envs] != clock.episode[envs]]
    if len(late):
        laid_out.episode[late] = clock.episode[late]
        laid_out.q[late], laid_out.u[late] = clock.task.initial_states(clock.episode[late])
        laid_out.first_targets[late] = clock.task.targets(clock.episode[late], np.zeros(len(late), np.int64))
