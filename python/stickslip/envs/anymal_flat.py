"""ANYmal walks at commanded speeds on flat ground: the velocity task of legged_gym and Isaac Lab. Every number and function of
it is in `AnymalFlatConfig`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip import assets
from stickslip._arguments import limit, number
from stickslip._batch_inputs import per_element
from stickslip.envs.commands import Commands, uniform_commands
from stickslip.envs.locomotion_state import Array, ContactColumns, LocomotionState, Mask
from stickslip.envs.observations import ObservationTerm, default_observations
from stickslip.envs.randomization import Pushes, Randomization, default_randomization, initial_state
from stickslip.envs.rewards import Reward, default_rewards
from stickslip.envs.single import single
from stickslip.envs.streams import Envs, RandomStreams
from stickslip.envs.task import VectorTask
from stickslip.envs.terminations import Termination, default_terminations
from stickslip.world import World

__all__ = ["AnymalFlat", "AnymalFlatConfig", "AnymalFlatEnv"]

LONGEST = np.iinfo(np.int32).max  # control steps to the next push or command: never
FOOT_FORCE = 1.0  # from which vertical force on it a point counts as touching, as legged_gym [N]


def stance() -> dict[str, float]:
    """Joint angles around which actions move the joints [rad]."""
    legs = {"LF": 1.0, "RF": 1.0, "LH": -1.0, "RH": -1.0}  # knees point inwards
    angles = {"HAA": 0.0, "HFE": 0.4, "KFE": -0.8}
    return {f"{leg}_{joint}": sign * angle for leg, sign in legs.items() for joint, angle in angles.items()}


@dataclass
class AnymalFlatConfig:
    """What the task is made of. Replace what you like: `AnymalFlatConfig(rewards=default_rewards() | {"alive": (0.5, alive)})`."""

    # Control
    time_step: float = 0.005  #: physics [s]
    decimation: int = 4  #: physics steps per action: 50 Hz
    integrator: str = "energy_safe"  #: of the `World`
    kp: float = 80.0  #: [N m/rad]
    kd: float = 2.0  #: [N m s/rad]
    action_scale: float = 0.5  #: from an action to an offset of the joint target [rad]
    action_limit: float = 4.0  #: actions are clipped to +- this
    stance: dict[str, float] = field(default_factory=stance)  #: joint targets of a zero action [rad]

    # Episode
    episode_seconds: float = 20.0  #: [s]
    base_height: float = 0.6  #: of the base where episodes begin; it falls a little [m]
    initial_state: Callable[[AnymalFlat, NDArray[np.int64]], tuple[Any, Any]] = initial_state  #: q (k, nq), u (k, nu)
    terminations: dict[str, Termination] = field(default_factory=default_terminations)

    # What the policy sees and wants
    observations: dict[str, ObservationTerm] = field(default_factory=default_observations)
    observation_noise: bool = False
    observation_limit: float = 100.0  #: observations are clipped to +- this
    commands: Commands = field(default_factory=Commands)
    draw_commands: Callable[[RandomStreams, Envs, Commands], Array] = uniform_commands
    rewards: dict[str, tuple[float, Reward]] = field(default_factory=default_rewards)  #: weight, function
    only_positive_rewards: bool = False  #: a negative sum becomes zero, as legged_gym has it

    # What differs between environments
    randomization: dict[str, Randomization] = field(default_factory=default_randomization)
    pushes: Pushes | None = field(default_factory=Pushes)

    def check(self) -> None:
        """TypeError or ValueError names the field that cannot be."""
        self._check_terms()
        if not isinstance(self.commands, Commands):
            kind = type(self.commands).__name__
            raise TypeError(f"commands is a {kind}; a stickslip.envs.commands.Commands is wanted")
        self.commands.check()
        if not isinstance(self.pushes, (Pushes, type(None))):
            kind = type(self.pushes).__name__
            raise TypeError(f"pushes is a {kind}; a stickslip.envs.randomization.Pushes or None is wanted")
        if self.pushes is not None:
            self.pushes.check()
        for name in ("action_scale", "base_height"):
            number(name, getattr(self, name))
        for name in ("action_limit", "observation_limit"):
            limit(name, getattr(self, name))

    def _check_terms(self) -> None:
        for where in ("observations", "rewards", "terminations", "randomization"):
            terms = getattr(self, where)
            if not isinstance(terms, dict):
                raise TypeError(
                    f"{where} is a {type(terms).__name__}; a dict of terms by name is wanted, {{}} for none"
                )
        for name, term in self.observations.items():
            if not isinstance(term, tuple) or not 1 <= len(term) <= 3 or not callable(term[0]):
                raise TypeError(
                    f"observations: {name!r} is {term!r}; an ObservationTerm(function, scale, noise) is wanted"
                )
        for name, term in self.rewards.items():
            if not isinstance(term, tuple) or len(term) != 2 or not callable(term[1]):
                raise TypeError(f"rewards: {name!r} is {term!r}; a tuple (weight, function) is wanted")
            number(f"rewards: the weight of {name!r}", term[0])
        functions = {f"terminations: {name!r}": term for name, term in self.terminations.items()}
        functions |= {f"randomization: {name!r}": term for name, term in self.randomization.items()}
        functions |= {"initial_state": self.initial_state, "draw_commands": self.draw_commands}
        for name, function in functions.items():
            if not callable(function):
                raise TypeError(f"{name} is {function!r}; a function is wanted")


class AnymalFlat(VectorTask):
    """ANYmal on flat ground, driven by joint targets, rewarded for walking at the commanded velocity."""

    def __init__(self, num_envs: int = 1, *, config: AnymalFlatConfig | None = None, **options: Any):
        self.config = c = AnymalFlatConfig() if config is None else config
        if not isinstance(c, AnymalFlatConfig):
            raise TypeError(f"config is a {type(c).__name__}; an AnymalFlatConfig is wanted")
        c.check()
        self.time_step, self.decimation, self.episode_seconds = c.time_step, c.decimation, c.episode_seconds
        self.action_limit, self.observation_limit = c.action_limit, c.observation_limit
        self.only_positive_rewards = c.only_positive_rewards
        super().__init__(num_envs, **options)

    # The scene

    def make_world(self) -> World:
        """ANYmal above a plane, in its stance."""
        world = World(self.config.time_step, integrator=self.config.integrator)
        world.add_ground()
        robot = world.add_robot(assets.path("anymal_b"))
        self.default_angles = _angles(robot.joint_names, self.config.stance)
        q = robot.q.copy()
        q[2], q[7:] = self.config.base_height, self.default_angles
        robot.set_state(q, np.zeros(robot.nu))
        robot.set_pd_gains(self.config.kp, self.config.kd)
        robot.pd_target = self.default_angles
        return world

    def setup(self) -> None:
        """Arrays, terms, timers."""
        c = self.config
        self.base = self.batch.model.bodies[0]
        self._angles = self.default_angles.astype(np.float32)
        self._columns = _contact_columns(self.batch.contact_points, FOOT_FORCE * self.world.time_step)
        self.state = LocomotionState.zeros(
            self.num_envs,
            len(self._angles),
            len(self._columns.feet),
            step_seconds=self.step_seconds,
            kp=c.kp,
            kd=c.kd,
        )
        self._command_steps = np.zeros(self.num_envs, np.int32)  # until the next command
        self._push_steps = np.zeros(self.num_envs, np.int32)
        self._reward_terms = np.zeros((len(c.rewards), self.num_envs), np.float32)
        self._lay_out_observation()

    def _lay_out_observation(self) -> None:
        """Columns, scale and noise of each term."""
        self._terms: list[tuple[Callable[[LocomotionState], Array], slice, Array]] = []
        noises: list[Array] = []
        begin = 0
        for name, term in self.config.observations.items():
            function, scale, noise = ObservationTerm(*term)
            shape = np.shape(function(self.state))
            if len(shape) != 2 or shape[0] != self.num_envs:
                raise ValueError(f"observation {name!r} has shape {shape}; it must be ({self.num_envs}, size)")
            scale = per_element(f"observations: the scale of {name!r}", scale, shape[1:])
            self._terms.append((function, slice(begin, begin + shape[1]), scale))
            noises.append(scale * per_element(f"observations: the noise of {name!r}", noise, shape[1:]))
            begin += shape[1]
        self._observed = np.zeros((self.num_envs, begin), np.float32)
        if self.config.observation_noise:
            self.observation_noise = np.concatenate(noises)

    @property
    def commands(self) -> Array:
        """(num_envs, 3) velocity forward, to the left [m/s], yaw rate [rad/s]; write here to steer until the next draw."""
        return self.state.commands

    # Episodes

    def begin_episodes(self, envs: NDArray[np.int64]) -> None:
        """Draws parameters, state and command."""
        c = self.config
        for randomize in c.randomization.values():
            randomize(self, envs)
        q, u = c.initial_state(self, envs)
        self.batch.reset(envs, q=q, u=u)
        self.batch.pd_target[envs] = self._angles
        self.state.begin(envs)
        self.state.joint_target[envs] = 0.0
        self.state.previous_joint_velocity[envs] = self.batch.u[envs, 6:]
        self._draw_commands(envs)
        if c.pushes is not None:
            self._draw_push_times(envs)

    def _draw_commands(self, envs: NDArray[np.int64]) -> None:
        self.state.commands[envs] = self.config.draw_commands(self.random, envs, self.config.commands)
        self._command_steps[envs] = round(min(self.config.commands.seconds / self.step_seconds, LONGEST))

    def _draw_push_times(self, envs: NDArray[np.int64]) -> None:
        low, high = np.minimum(self.config.pushes.seconds, LONGEST * self.step_seconds)
        steps = np.rint(self.random.uniform(envs, low, high) / np.float32(self.step_seconds))
        self._push_steps[envs] = np.minimum(steps.astype(np.float64), LONGEST).astype(np.int32)

    # Steps

    def apply(self, actions: Array) -> None:
        """Scaled offsets from the stance to PD targets."""
        np.multiply(actions, np.float32(self.config.action_scale), out=self.state.joint_target)
        np.add(self.state.joint_target, self._angles, out=self.batch.pd_target, casting="same_kind")

    def simulate(self, live: Mask) -> None:
        """Pushes, steps, looks for contacts."""
        if self.config.pushes is not None:
            due = _count_down(self._push_steps, live)
            if len(due):
                self.config.pushes.function(self, due)
                self._draw_push_times(due)
        np.copyto(self.state.previous_joint_velocity, self.batch.u[:, 6:], casting="same_kind")
        super().simulate(live)
        self.state.measure_contacts(self.batch.contact_impulse, self._columns)

    def refresh(self, envs: Envs) -> None:
        """Base and joints as the terms want them."""
        self.state.actions, self.state.previous_actions = self.actions, self.previous_actions
        if self.batch.has_own("kp"):
            self.state.kp = self.batch.kp
        if self.batch.has_own("kd"):
            self.state.kd = self.batch.kd
        if isinstance(envs, slice):
            self.state.measure(self.batch.q, self.batch.u, self._angles)
            return
        rows = self.state.rows(envs)
        rows.measure(self.batch.q[envs], self.batch.u[envs], self._angles)
        self.state.set_measured(envs, rows)

    def between_steps(self, live: Mask) -> None:
        """New commands."""
        due = _count_down(self._command_steps, live)
        if len(due):
            self._draw_commands(due)

    # Terms

    def observe(self) -> Array:
        """(num_envs, 48) with the default terms."""
        return self._write_observation(self.state, self._observed)

    def observe_some(self, envs: NDArray[np.int64]) -> Array:
        """Rows of it."""
        out = np.empty((len(envs), self._observed.shape[1]), np.float32)
        return self._write_observation(self.state.rows(envs), out)

    def _write_observation(self, state: LocomotionState, out: Array) -> Array:
        for function, columns, scale in self._terms:
            np.multiply(function(state), scale, out=out[:, columns])
        return out

    def rewards(self) -> dict[str, Array]:
        """Weighted terms of the control step."""
        rows: dict[str, Array] = {}
        for row, (name, (weight, function)) in zip(self._reward_terms, self.config.rewards.items(), strict=True):
            term = function(self.state)
            self._check_term("rewards", name, term)
            np.multiply(term, np.float32(weight * self.step_seconds), out=row)
            rows[name] = row
        return rows

    def terminations(self) -> dict[str, Mask]:
        """Falls."""
        return {name: function(self.state) for name, function in self.config.terminations.items()}


def _count_down(steps: NDArray[np.int32], live: Mask) -> NDArray[np.int64]:
    """Counts one step; returns indices of those for whom it was the last."""
    steps -= live
    return np.flatnonzero((steps <= 0) & live)


def _angles(joint_names: list[str], stance: dict[str, float]) -> NDArray[np.float64]:
    """In the order of the model."""
    if sorted(stance) != sorted(joint_names):
        wrong = ", ".join(sorted(set(stance) ^ set(joint_names)))
        raise ValueError(f"stance must have one angle for each of {', '.join(joint_names)}; it differs at {wrong}")
    return np.array([stance[name] for name in joint_names])


def _contact_columns(points: list[Any], threshold: float) -> ContactColumns:
    """Columns of `Batch.contact_impulse` that belong to feet, base, other bodies."""
    feet: dict[str, list[int]] = {}
    others: dict[str, list[int]] = {}
    for column, point in enumerate(points):
        group = feet if "FOOT" in point.shape else others
        group.setdefault(point.shape if group is feet else point.body, []).append(column)
    return ContactColumns(list(feet.values()), [others.pop("base"), *others.values()], threshold)


AnymalFlatEnv = single(AnymalFlat)
