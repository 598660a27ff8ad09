"""The life of a task on a batch: actions, steps, episodes, seeds, infos. A task itself is a few functions on whole batches.

A new task is one class (docs/write_your_own_task.md): `make_world`, `apply`, `observe`, `rewards`, and where it wants them
`terminations`, `begin_episodes`, `setup`.
"""

from __future__ import annotations

import inspect
import operator
from collections.abc import Sequence
from typing import Any, NoReturn

import numpy as np
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from stickslip._arguments import count, number
from stickslip._batch_inputs import numbers, per_element
from stickslip.envs.infos import vector_info
from stickslip.envs.streams import Envs, RandomStreams
from stickslip.world import StepStatus, World

__all__ = ["ALL", "VectorTask"]

Array = NDArray[np.float32]
Mask = NDArray[np.bool_]
ALL = slice(None)  #: as `envs`: every environment


class VectorTask(VectorEnv):
    """A Gymnasium vector environment on one `stickslip.Batch`. Arrays have one row per environment.

    num_envs: environments. autoreset_mode: a `gymnasium.vector.AutoresetMode`, or its value ("NextStep", "SameStep",
    "Disabled"). max_episode_steps: instead of what `episode_seconds` gives; a single environment has the latter.
    dtype, num_threads, batch_options: of the `Batch`.

    Attributes for the methods of a task: `batch`, `world` and `robot` (which the batch was made of), `random` (one stream per
    environment), `actions` and `previous_actions` (num_envs, action_size), `episode_steps` (num_envs,), `step_seconds`.
    """

    # What a task may set, in its class or in `setup`.
    time_step: float = 0.005  #: of the physics [s]; for `make_world`
    decimation: int = 4  #: physics steps per action
    episode_seconds: float = 20.0  #: episodes are truncated then [s]
    action_size: int | None = None  #: None: one per joint
    action_limit: float = 1.0  #: actions are clipped to +- this
    observation_limit: float = 100.0  #: observations are clipped to +- this
    observation_noise: ArrayLike | None = None  #: uniform, +- this; a number or one per element
    only_positive_rewards: bool = False  #: a negative sum of reward terms becomes zero

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    # What a task writes

    def make_world(self) -> World:
        """The scene of which the batch holds copies: one robot, gains and state as episodes begin."""
        raise NotImplementedError(f"{type(self).__name__} needs a method make_world() that returns a stickslip.World")

    def setup(self) -> None:
        """Allocates what the task keeps per environment; `batch` is there."""

    def begin_episodes(self, envs: NDArray[np.int64]) -> None:
        """Puts environments into the state in which an episode begins. Without it: the state that the world had."""
        self.batch.reset(envs)

    def apply(self, actions: Array) -> None:
        """Writes actions (num_envs, action_size) into the batch: `pd_target`, `generalized_force`."""
        raise NotImplementedError(f"{type(self).__name__} needs a method apply(actions) that drives self.batch")

    def observe(self) -> Array:
        """(num_envs, observation size), of the present state; changes nothing."""
        raise NotImplementedError(f"{type(self).__name__} needs a method observe() that returns (num_envs, size)")

    def rewards(self) -> Array | dict[str, Array]:
        """(num_envs,) of the last step; or terms by name, which are added, and summed over an episode for its info."""
        raise NotImplementedError(f"{type(self).__name__} needs a method rewards() that returns (num_envs,)")

    def terminations(self) -> Mask | dict[str, Mask]:
        """(num_envs,) whose episode ends by what happened; or causes by name. Time limits are not among them."""
        return {}

    # What a task may also write

    def simulate(self, live: Mask) -> None:
        """From `self.actions` to the next state. `live` (num_envs,): in the midst of an episode."""
        self.apply(self.actions)
        self.batch.step(self.decimation)

    def refresh(self, envs: Envs) -> None:
        """Derives what several methods need from the state of `envs` (indices or slice(None)); after a step, after a reset."""

    def between_steps(self, live: Mask) -> None:
        """After the rewards of a step and before its observation: new commands, moving targets."""

    def observe_some(self, envs: NDArray[np.int64]) -> Array:
        """Rows `envs` of `observe`; for a task that can make them cheaper."""
        return self.observe()[envs]

    # Making

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        dtype: str = "float32",
        num_threads: int = 0,
        render_mode: None = None,
        **batch_options: Any,
    ):
        if render_mode is not None:
            raise ValueError(f"render_mode is {render_mode!r}; this task draws nothing, use None")
        self.num_envs = count("num_envs", num_envs, least=1)
        self.autoreset_mode = _autoreset_mode(autoreset_mode)
        self.metadata = dict(self.metadata, autoreset_mode=self.autoreset_mode)
        self._make_batch(dtype, num_threads, batch_options)
        if max_episode_steps is None:
            max_episode_steps = self._steps_of_an_episode()
        self.max_episode_steps = count("max_episode_steps", max_episode_steps, least=1)
        self._allocate()
        self.setup()
        self._make_spaces()

    def _make_batch(self, dtype: str, num_threads: int, options: dict[str, Any]) -> None:
        from stickslip.batch import Batch

        _check_options(type(self), options)
        self.world = self.make_world()
        self.robot = self.world.robots[0] if self.world.robots else None
        # Robots that walk in steps of some milliseconds change their feet too soon for it (docs/design/011).
        options = {"regroup_every": 0, **options}
        self.batch = Batch(self.world, self.num_envs, dtype, num_threads, **options)
        self.step_seconds = self.world.time_step * count("decimation", self.decimation, least=1)
        if self.action_size is None:
            self.action_size = self.batch.model.num_joints

    def _steps_of_an_episode(self) -> int:
        seconds = number("episode_seconds", self.episode_seconds)
        if not round(seconds / self.step_seconds) >= 1:
            raise ValueError(f"episode_seconds is {seconds}; an action alone lasts {self.step_seconds:.6g} s")
        return round(seconds / self.step_seconds)

    def _allocate(self) -> None:
        self.random = RandomStreams(self.num_envs)
        self.actions = np.zeros((self.num_envs, self.action_size), np.float32)
        self.previous_actions = np.zeros_like(self.actions)
        self.episode_steps = np.zeros(self.num_envs, np.int32)
        self._ended = np.zeros(self.num_envs, np.bool_)  # whose episode is over and has not begun again
        self._reward_sums: dict[str, Array] = {}
        self._seeded = self._begun = False

    def _make_spaces(self) -> None:
        self.refresh(ALL)
        shape = np.shape(self.observe())
        if len(shape) != 2 or shape[0] != self.num_envs:
            raise ValueError(f"observe() returned shape {shape}; it must be ({self.num_envs}, size)")
        self._observation = np.zeros(shape, np.float32)
        if self.observation_noise is not None:
            self.observation_noise = per_element("observation_noise", self.observation_noise, shape[1:])
        limit, action = np.float32(self.observation_limit), np.float32(self.action_limit)
        self.single_observation_space = Box(-limit, limit, shape[1:], np.float32)
        self.single_action_space = Box(-action, action, (self.action_size,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def __reduce__(self) -> NoReturn:
        raise TypeError(  # for copy, deepcopy and pickle alike
            f"a {type(self).__name__} can be neither copied nor pickled; make another one with the same arguments"
        )

    # Gymnasium

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begins episodes: of all environments, or of those in options["reset_mask"], a bool array (num_envs,).

        seed: an integer (environment i draws the stream of (seed, i)), or one per environment (then environment i draws what a
        single environment with seed seeds[i] draws); None: streams go on. Returns observations of all environments.
        """
        self._check_open()
        envs = self._chosen(options)
        self._seed(seed, envs)
        self._begin(envs)
        if len(envs) == self.num_envs:
            self._observe_all()
        else:
            self._observation[envs] = self._finished(self.observe_some(envs), envs)
        return self._observation.copy(), {}

    def step(self, actions: ArrayLike) -> tuple[Array, Array, Mask, Mask, dict[str, Any]]:
        """One action (num_envs, action_size) for every environment.

        An environment whose action (as float32, so not 1e300), state or reward is not finite is terminated with reward zero
        and named in the infos "invalid_action", "non_finite" or "non_finite_reward"; the others do not notice. Infos of an ended episode: "reward_terms" (sums),
        "termination_terms", "episode_steps"; with "SameStep" they are in "final_info", beside "final_obs".

        TypeError or ValueError for actions that are no numbers or of another shape; ResetNeeded where `reset` is due.
        """
        self._check_open()
        self._check_begun()
        live = ~self._ended
        invalid = self._take(actions, live)
        self.simulate(live)
        if self._ended.any():  # "NextStep": this step is their reset
            self._begin(np.flatnonzero(self._ended))
        self.refresh(ALL)
        self.episode_steps += live
        broken, infos = self._broken(invalid, live)
        rewards, worthless = self._rewards(live & ~broken)
        if worthless is not None:
            infos |= worthless
            broken |= worthless["_non_finite_reward"]
        causes, terminated = self._terminations(broken, live)
        truncated = live & ~terminated & (self.episode_steps >= self.max_episode_steps)
        done = terminated | truncated
        self.between_steps(live & ~done)
        self._observe_all()
        if done.any():
            self._end(done, infos, causes)
        return self._observation.copy(), rewards, terminated, truncated, infos

    def close_extras(self, **kwargs: Any) -> None:
        """Gives memory and threads of the batch back."""
        self.batch = None

    # Parts of a step

    def _take(self, actions: ArrayLike, live: Mask) -> Mask | None:
        """Puts actions into `self.actions`; returns who sent one that is not finite, None for nobody."""
        given = numbers("actions", actions)
        if given.shape != self.actions.shape:
            raise ValueError(f"actions has shape {given.shape}; it must be {self.actions.shape}, a row per environment")
        self.actions, self.previous_actions = self.previous_actions, self.actions
        with np.errstate(all="ignore"):  # what overflows is found below
            np.copyto(self.actions, given, casting="unsafe")
            if not live.all():
                self.actions[~live] = 0.0
            if np.isfinite(self.actions.sum()):  # only if all are, and much cheaper to see
                invalid = None
            else:
                invalid = ~np.isfinite(self.actions).all(axis=1)
                self.actions[invalid] = 0.0
        np.clip(self.actions, -self.action_limit, self.action_limit, out=self.actions)
        return invalid

    def _broken(self, invalid: Mask | None, live: Mask) -> tuple[Mask, dict[str, Any]]:
        """Whose action or state is not finite, and the infos that say so."""
        infos: dict[str, Any] = {}
        broken = (self.batch.status & int(StepStatus.NON_FINITE)) != 0
        broken &= live
        if broken.any():
            infos |= vector_info({"non_finite": broken}, broken)
        if invalid is not None and invalid.any():
            infos |= vector_info({"invalid_action": invalid}, invalid)
            broken |= invalid
        return broken, infos

    def _rewards(self, counted: Mask) -> tuple[Array, dict[str, Any] | None]:
        """The sum of the terms, which are added up over the episode; zero where nothing counts. And infos on whose sum is not
        finite, and by which terms; None for nobody."""
        terms = self.rewards()
        if not isinstance(terms, dict):
            terms = {"reward": terms}
        total = np.zeros(self.num_envs, np.float32)
        everywhere = True if counted.all() else counted
        worthless = None
        with np.errstate(all="ignore"):  # what is not finite is found below
            for name, term in terms.items():
                self._check_term("rewards", name, term)
                np.add(total, term, out=total, where=everywhere)
            if not np.isfinite(total.sum()):  # finite only if all are, and much cheaper to see
                bad = ~np.isfinite(total)
                if bad.any():
                    culprits = {name: ~np.isfinite(term) for name, term in terms.items()}
                    worthless = vector_info({"non_finite_reward": culprits}, bad)
                    everywhere = counted & ~bad
                    total[bad] = 0.0
        for name, term in terms.items():
            if name not in self._reward_sums:
                self._reward_sums[name] = np.zeros(self.num_envs, np.float32)
            sums = self._reward_sums[name]
            np.add(sums, term, out=sums, where=everywhere)
        return (np.maximum(total, 0.0, out=total) if self.only_positive_rewards else total), worthless

    def _terminations(self, broken: Mask, live: Mask) -> tuple[dict[str, Mask], Mask]:
        """Causes by name, and who has one."""
        causes = self.terminations()
        if not isinstance(causes, dict):
            causes = {"terminated": causes}
        causes = {name: np.asarray(mask) for name, mask in causes.items()}
        terminated = broken.copy()
        for name, mask in causes.items():
            self._check_term("terminations", name, mask, np.bool_)
            terminated |= mask
        terminated &= live
        return causes, terminated

    def _end(self, done: Mask, infos: dict[str, Any], causes: dict[str, Mask]) -> None:
        """Adds the infos of ended episodes; begins the next ones if the mode says so."""
        ended = vector_info(
            {"reward_terms": self._reward_sums, "termination_terms": causes, "episode_steps": self.episode_steps}, done
        )
        if self.autoreset_mode is not AutoresetMode.SAME_STEP:
            infos |= ended
            self._ended = done
            return
        envs = np.flatnonzero(done)
        last = np.full(self.num_envs, None, object)  # rows as objects, as Gymnasium's own environments have it
        last[envs] = np.fromiter(self._observation[envs], object, len(envs))
        broken = {name: mask.copy() for name, mask in infos.items()}
        infos |= {
            "final_obs": last,
            "_final_obs": done.copy(),
            "final_info": broken | ended,
            "_final_info": done.copy(),
        }
        self._begin(envs)
        self._observation[envs] = self._finished(self.observe_some(envs), envs)

    def _begin(self, envs: NDArray[np.int64]) -> None:
        """Begins episodes."""
        self.actions[envs] = 0.0
        self.previous_actions[envs] = 0.0
        self.episode_steps[envs] = 0
        for sums in self._reward_sums.values():
            sums[envs] = 0.0
        self._ended[envs] = False
        self._begun = True
        self.begin_episodes(envs)
        self.refresh(ALL if len(envs) == self.num_envs else envs)

    def _observe_all(self) -> None:
        np.copyto(self._observation, self._finished(self.observe(), ALL))

    def _finished(self, observation: Array, envs: Envs) -> Array:
        """With noise, inside the observation space."""
        if self.observation_noise is not None:
            noise = self.observation_noise
            observation = observation + self.random.uniform(envs, -noise, noise, observation.shape[1])
        return np.clip(observation, -self.observation_limit, self.observation_limit)

    # Checks

    def _check_open(self) -> None:
        if self.closed:
            raise ClosedEnvironmentError(f"{self} was closed; make another one")

    def _check_term(self, method: str, name: str, term: Any, dtype: type | None = None) -> None:
        if np.shape(term) != (self.num_envs,):
            raise ValueError(f"{method}(): {name!r} has shape {np.shape(term)}; it must be ({self.num_envs},)")
        if dtype is not None and term.dtype != dtype:
            raise TypeError(f"{method}(): {name!r} has dtype {term.dtype}; bool is wanted")

    def _check_begun(self) -> None:
        if not self._begun:
            raise ResetNeeded("call reset() before the first step()")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._ended.any():
            envs = np.flatnonzero(self._ended)
            shown = ", ".join(map(str, envs[:6])) + (f" and {len(envs) - 6} more" if len(envs) > 6 else "")
            raise ResetNeeded(
                f"the episodes of environments {shown} are over and autoreset_mode is Disabled; "
                "call reset(options={'reset_mask': terminated | truncated}) before the next step()"
            )

    def _chosen(self, options: dict[str, Any] | None) -> NDArray[np.int64]:
        """Indices of the environments to reset."""
        if options is None or "reset_mask" not in options:
            return np.arange(self.num_envs)
        mask = options["reset_mask"]
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            kind = f"an array of {mask.dtype}" if isinstance(mask, np.ndarray) else f"a {type(mask).__name__}"
            raise TypeError(f"options['reset_mask'] is {kind}; a NumPy array of bool is wanted")
        if mask.shape != (self.num_envs,):
            raise ValueError(f"options['reset_mask'] has shape {mask.shape}; it must be ({self.num_envs},)")
        if not mask.any():
            raise ValueError("options['reset_mask'] has no True; leave reset() out, or name an environment")
        if not self._begun and not mask.all():
            raise ResetNeeded(
                "options['reset_mask'] leaves environments out that have not begun yet; call reset() first"
            )
        return np.flatnonzero(mask)

    def _seed(self, seed: int | Sequence[int | None] | None, envs: NDArray[np.int64]) -> None:
        """Begins streams of random numbers."""
        if seed is None and not self._seeded:
            seed = self.np_random_seed  # drawn from the machine's entropy
            seed = int(self.np_random.integers(2**63)) if seed < 0 else seed
            self.random.seed(seed)
        elif isinstance(seed, (Sequence, np.ndarray)) and not isinstance(seed, str):
            if len(seed) != self.num_envs:
                raise ValueError(f"seed has {len(seed)} elements; it must be one integer or {self.num_envs} of them")
            seeds = [None if s is None else _seed(f"seed[{i}]", s) for i, s in enumerate(seed)]
            if not self._seeded and None in seeds:
                raise ValueError(f"seed[{seeds.index(None)}] is None, but that environment has no stream to go on with")
            self.random.seed_each(seeds, envs)
        elif seed is not None:
            value = _seed("seed", seed)
            super().reset(seed=value)
            self.random.seed(value, envs if self._seeded else ALL)
        self._seeded = True


def _check_options(task_class: type[VectorTask], options: dict[str, Any]) -> None:
    """What no constructor of the task names must be an option of `Batch`."""
    from stickslip.batch import Batch

    named = [p for c in task_class.__mro__ if "__init__" in vars(c) for p in inspect.signature(c).parameters.values()]
    batch = [p.name for p in inspect.signature(Batch).parameters.values() if p.kind is p.KEYWORD_ONLY]
    unknown = ", ".join(sorted(set(options) - set(batch)))
    if unknown:
        known = [p.name for p in named if p.kind is not p.VAR_KEYWORD and p.name != "self"]
        raise TypeError(
            f"{task_class.__name__} has no argument {unknown}; it takes {', '.join(dict.fromkeys(known + batch))}"
        )


def _seed(name: str, value: Any) -> int:
    try:
        result = operator.index(value)
    except TypeError:
        raise TypeError(f"{name} is {value!r}; an integer is wanted") from None
    if result < 0:
        raise ValueError(f"{name} is {result}; it must be zero or positive")
    return result


def _autoreset_mode(value: AutoresetMode | str) -> AutoresetMode:
    try:
        return AutoresetMode(value)
    except ValueError:
        modes = ", ".join(repr(mode.value) for mode in AutoresetMode)
        raise ValueError(f"autoreset_mode is {value!r}; an AutoresetMode or one of {modes} is wanted") from None
