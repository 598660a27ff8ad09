"""Tasks that users write, and the random streams they draw from."""

from __future__ import annotations

import copy
import functools
import pickle
import runpy
import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import stickslip as ss
from stickslip.envs import RandomStreams, VectorTask, register

if not hasattr(ss, "Batch"):
    pytest.skip("needs stickslip.Batch", allow_module_level=True)

ROOT = Path(__file__).resolve().parents[2]


class Falling(VectorTask):
    """A ball falls; the smallest task there is."""

    episode_seconds = 0.1
    action_size = 1

    def make_world(self) -> ss.World:
        builder = ss.ModelBuilder("ball")
        builder.add_link("ball", mass=1.0, inertia=0.01 * np.eye(3))
        builder.add_shape("ball", "sphere", [0.1])
        world = ss.World(self.time_step)
        world.add_ground()
        world.add_robot(builder.build(), position=(0, 0, 1))
        return world

    def apply(self, actions: np.ndarray) -> None:
        self.batch.generalized_force[:, 2] = actions[:, 0]

    def observe(self) -> np.ndarray:
        return self.batch.q[:, 2:3]

    def rewards(self) -> np.ndarray:
        return self.batch.q[:, 2]


def test_smallest_task_runs_in_every_mode_and_alone() -> None:
    register("tests/Falling-v0", Falling)
    for mode in ("NextStep", "SameStep", "Disabled"):
        envs = gymnasium.make_vec("tests/Falling-v0", num_envs=3, autoreset_mode=mode)
        envs.reset(seed=0)
        results = [envs.step(np.ones((3, 1))) for _ in range(5)]
        assert results[-1][3].all() and not results[-1][2].any()
        ended = results[-1][4]["final_info"] if mode == "SameStep" else results[-1][4]
        assert np.allclose(ended["reward_terms"]["reward"], sum(result[1] for result in results))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make("tests/Falling-v0").unwrapped)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"observe": lambda self: np.zeros(3)}, ValueError, r"observe\(\) returned shape \(3,\)"),
        ({"rewards": lambda self: np.zeros((3, 1))}, ValueError, r"rewards\(\): 'reward' has shape \(3, 1\)"),
        ({"terminations": lambda self: {"end": np.zeros(3)}}, TypeError, "'end' has dtype float64; bool"),
        ({"rewards": VectorTask.rewards}, NotImplementedError, r"Broken needs a method rewards\(\)"),
        ({"observation_noise": np.nan}, ValueError, "observation_noise is nan; it must be finite"),
        ({"observation_noise": np.ones(7)}, ValueError, r"observation_noise has shape \(7,\); it must be a number, or"),
        ({"observation_noise": "much"}, TypeError, "observation_noise holds str"),
    ],
)
def test_mistakes_in_a_task_are_named(change: dict[str, Any], error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        envs = type("Broken", (Falling,), change)(3)
        envs.reset(seed=0)
        envs.step(np.zeros((3, 1)))


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_reward_that_is_not_finite_ends_that_episode_only(mode: str) -> None:
    def terms(self: VectorTask) -> dict[str, np.ndarray]:
        return {"one": np.ones(3), "bad": np.where(self.actions[:, 0] < 0, np.nan, 1.0)}

    envs = type("Bad", (Falling,), {"rewards": terms})(3, autoreset_mode=mode)
    envs.reset(seed=0)
    envs.step(np.ones((3, 1)))
    _, reward, terminated, _, infos = envs.step([[1.0], [-1.0], [1.0]])
    assert reward.tolist() == [2, 0, 2] and terminated.tolist() == [False, True, False]
    for told in (infos, infos["final_info"]) if mode == "SameStep" else (infos,):
        assert told["_non_finite_reward"].tolist() == [False, True, False]
        assert told["non_finite_reward"]["bad"].tolist() == [False, True, False]
        assert not told["non_finite_reward"]["one"].any()
    ended = infos["final_info"] if mode == "SameStep" else infos
    assert ended["reward_terms"]["one"][1] == ended["reward_terms"]["bad"][1] == 1.0


@pytest.mark.parametrize("act", [copy.copy, copy.deepcopy, pickle.dumps])
def test_copies_are_refused_with_advice(act: Any) -> None:
    with pytest.raises(TypeError, match="a Falling can be neither copied nor pickled; make another one"):
        act(Falling(2))


def test_terms_may_be_lists() -> None:
    lists = {"rewards": lambda self: [1, 2, 3], "terminations": lambda self: [False, True, False]}
    envs = type("Lists", (Falling,), lists)(3)
    envs.reset(seed=0)
    _, reward, terminated, _, infos = envs.step(np.zeros((3, 1)))
    assert reward.tolist() == [1, 2, 3] and terminated.tolist() == [False, True, False]
    assert infos["termination_terms"]["terminated"].tolist() == [False, True, False]


def test_unknown_arguments_are_named_beside_those_of_the_task() -> None:
    with pytest.raises(
        TypeError, match=r"Falling has no argument foo; it takes num_envs, .*pin_threads, instruction_set"
    ):
        Falling(3, foo=1)


def test_batch_regroups_only_where_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    make = ss.Batch.__init__

    @functools.wraps(make)
    def watched(self, *args, **options) -> None:
        asked.append(options["regroup_every"])
        make(self, *args, **options)

    monkeypatch.setattr(ss.Batch, "__init__", watched)
    Falling(3)
    Falling(3, regroup_every=8)
    assert asked == [0, 8]


def test_regrouping_of_the_batch_shows_in_no_observation() -> None:
    module = SimpleNamespace(**runpy.run_path(str(ROOT / "examples" / "write_your_own_task.py")))
    task = next(
        x for x in vars(module).values() if isinstance(x, type) and issubclass(x, VectorTask) and x is not VectorTask
    )
    plain, regrouped = task(40), task(40, regroup_every=1)
    rng = np.random.default_rng(2)
    for envs in (plain, regrouped):
        envs.reset(seed=3)
    for _ in range(40):
        action = rng.uniform(-1, 1, plain.action_space.shape).astype(np.float32)
        a, b = plain.step(action), regrouped.step(action)
        assert a[0].tobytes() == b[0].tobytes() and a[1].tobytes() == b[1].tobytes()


def test_example_jumps(capsys) -> None:
    module = SimpleNamespace(**runpy.run_path(str(ROOT / "examples" / "write_your_own_task.py")))
    module.check()
    assert "bases rose to" in capsys.readouterr().out


def test_page_shows_the_example() -> None:
    example = (ROOT / "examples" / "write_your_own_task.py").read_text(encoding="utf-8")
    page = (ROOT / "docs" / "write_your_own_task.md").read_text(encoding="utf-8")
    assert f"```python\n{example}```" in page


def test_streams_are_uniform_and_independent() -> None:
    streams = RandomStreams(1000)
    streams.seed(0)
    draws = streams.uniform(slice(None), -1.0, 3.0, 101)
    assert draws.dtype == np.float32 and draws.min() >= -1.0 and draws.max() <= 3.0
    assert abs(draws.mean() - 1.0) < 0.02 and abs(draws.var() - 16 / 12) < 0.02
    for one, next_one in ((draws[:-1], draws[1:]), (draws[:, :-1], draws[:, 1:])):
        assert abs(np.corrcoef(one.ravel(), next_one.ravel())[0, 1]) < 0.02
    normal = streams.normal(slice(None), 2.0, 50)
    assert abs(normal.mean()) < 0.05 and abs(normal.std() - 2.0) < 0.05
    dice = streams.integers(slice(None), 1, 7, 60)
    assert np.abs(np.bincount(dice.ravel(), minlength=7)[1:] / dice.size - 1 / 6).max() < 0.01
    assert streams.uniform(np.array([3, 5]), 0.0, 1.0).shape == (2,)


def test_huge_seeds_are_different_seeds() -> None:
    def first(seed: int) -> float:
        streams = RandomStreams(1)
        streams.seed(seed)
        return float(streams.uniform(slice(None), 0.0, 1.0)[0])

    assert len({first(seed) for seed in (0, 1, 2**64, 2**64 + 1, 2**128, 2**200 + 1)}) == 6
