"""Environments as Gymnasium knows them: registration, spaces, autoreset modes, infos, seeds, errors."""

from __future__ import annotations

import subprocess
import sys
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import vector as wrappers

import stickslip as ss
from env_runs import ID, MODES, actions_of, assert_same_steps, lively, make, run
from stickslip.envs import AnymalFlat, AnymalFlatConfig, observations, rewards
from stickslip.envs.commands import Commands
from stickslip.envs.randomization import Pushes

if not hasattr(ss, "Batch"):
    pytest.skip("needs stickslip.Batch", allow_module_level=True)


# Gymnasium knows it


def test_make_vec_gives_the_native_environment() -> None:
    for mode in ({}, {"vectorization_mode": "vector_entry_point"}):
        envs = gymnasium.make_vec(ID, num_envs=3, **mode)
        assert isinstance(envs, AnymalFlat) and isinstance(envs, gymnasium.vector.VectorEnv)
        assert envs.num_envs == 3 and envs.batch.num_envs == 3
        assert envs.spec.id == ID and "stickslip/AnymalFlat-v0" in repr(envs)
        assert envs.metadata == {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}
        assert envs.render_mode is None


def test_spaces_are_float32_and_contain_what_comes_and_goes() -> None:
    envs = make(3)
    assert envs.single_observation_space.shape == (48,) and envs.observation_space.shape == (3, 48)
    assert envs.single_action_space.shape == (12,) and envs.action_space.shape == (3, 12)
    assert envs.observation_space.dtype == envs.action_space.dtype == np.float32
    observation, infos = envs.reset(seed=0)
    assert observation in envs.observation_space and infos == {}
    observation, reward, terminated, truncated, _ = envs.step(envs.action_space.sample())
    assert observation in envs.observation_space
    assert reward.shape == terminated.shape == truncated.shape == (3,)
    assert reward.dtype == np.float32 and terminated.dtype == truncated.dtype == np.bool_


def test_module_prefix_registers_in_a_fresh_process() -> None:
    code = f"import gymnasium; print(gymnasium.make_vec('stickslip.envs:{ID}', num_envs=2))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == f"AnymalFlat({ID}, num_envs=2)"


def test_importing_stickslip_does_not_import_gymnasium() -> None:
    code = "import sys, stickslip; sys.exit('gymnasium' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_missing_gymnasium_is_named_with_its_remedy() -> None:
    code = "import sys; sys.modules['gymnasium'] = None; import stickslip.envs"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert result.returncode == 1 and "pip install '.[gym]'" in result.stderr


def test_specification_survives_json() -> None:
    spec = gymnasium.spec(ID)
    assert gymnasium.envs.registration.EnvSpec.from_json(spec.to_json()) == spec


def test_official_checker_accepts_the_single_environment() -> None:
    env = gymnasium.make(ID)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(env.unwrapped)
    # Joint targets need more than one action scale of offset: see docs/envs.md.
    told = [str(w.message) for w in caught if "symmetric and normalized space" not in str(w.message)]
    assert told == []


def test_single_environment_ends_by_itself_at_the_time_limit() -> None:
    env = gymnasium.make(ID, config=AnymalFlatConfig(episode_seconds=0.1))
    env.reset(seed=2)
    truncated = [env.step(np.zeros(12, np.float32))[3] for _ in range(5)]
    assert truncated == [False] * 4 + [True]
    with pytest.raises(ResetNeeded):
        env.step(np.zeros(12, np.float32))


def test_arrays_that_were_returned_are_not_touched_again() -> None:
    for mode in MODES:
        envs = make(4, mode)
        observation, _ = envs.reset(seed=1)
        given = [(observation, observation.copy())]
        for result in run(envs, 30):
            given += [(array, array.copy()) for array in result[:4]]
        assert all(np.array_equal(array, copy) for array, copy in given)


# Autoreset


@pytest.mark.parametrize("mode", MODES)
def test_is_gymnasiums_own_vector_of_single_environments_bit_for_bit(mode: AutoresetMode) -> None:
    n, steps, seeds = 5, 80, [11, 12, 13, 14, 15]
    native = make(n, mode)
    vector = gymnasium.make_vec(
        ID, num_envs=n, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, config=lively()
    )
    assert vector.observation_space == native.observation_space and vector.action_space == native.action_space
    assert np.array_equal(native.reset(seed=seeds)[0], vector.reset(seed=11)[0])
    a, b = run(native, steps), run(vector, steps)
    assert_same_steps(a, b)
    assert all(data_equivalence(x[4], y[4], exact=True) for x, y in zip(a, b, strict=True))
    assert any(x[2].any() for x in a) and any(x[3].any() for x in a), "no episode ended: the test tests nothing"


def test_next_step_resets_in_the_step_after_the_last() -> None:
    envs = make(6, AutoresetMode.NEXT_STEP)
    envs.reset(seed=3)
    over = np.zeros(6, bool)
    for step in range(60):
        _, reward, terminated, truncated, infos = envs.step(actions_of(step, 6))
        assert not (terminated | truncated)[over].any() and not reward[over].any()
        assert not envs.episode_steps[over].any() and not envs.actions[over].any()
        assert (envs.episode_steps[~over] > 0).all()
        assert "final_obs" not in infos
        over = terminated | truncated
        assert (("reward_terms" in infos) == over.any()) and (not over.any() or (infos["_reward_terms"] == over).all())
    assert envs.episode_steps.min() < 25


def test_same_step_hands_out_the_last_observation_beside_the_first() -> None:
    seeds = [5, 6, 7, 8]
    envs, other = make(4, AutoresetMode.SAME_STEP), make(4, AutoresetMode.NEXT_STEP)
    envs.reset(seed=seeds)
    other.reset(seed=seeds)
    ended = np.zeros(4, bool)  # after its first end, an environment of `other` is a step behind
    for step in range(30):
        observation, _, terminated, truncated, infos = envs.step(actions_of(step, 4))
        last = other.step(actions_of(step, 4))[0]
        done = terminated | truncated
        fresh = done & ~ended
        if done.any():
            assert (infos["_final_obs"] == done).all() and (infos["_final_info"] == done).all()
            assert all((row is not None) == over for row, over in zip(infos["final_obs"], done, strict=True))
            assert not envs.episode_steps[done].any()
            steps = infos["final_info"]["episode_steps"]
            assert (steps[done] > 0).all() and not steps[~done].any()
        for env in np.flatnonzero(fresh):
            assert np.array_equal(infos["final_obs"][env], last[env])
            assert not np.array_equal(observation[env], last[env])
        ended |= done
    assert ended.all()


def test_disabled_waits_for_a_reset_of_what_ended() -> None:
    envs = make(4, AutoresetMode.DISABLED)
    envs.reset(seed=4)
    for step in range(60):
        observation, _, terminated, truncated, _ = envs.step(actions_of(step, 4))
        done = terminated | truncated
        if done.any() and not done.all():
            break
    env = int(np.flatnonzero(done)[0])
    with pytest.raises(ResetNeeded, match=f"environments {env}"):
        envs.step(actions_of(0, 4))
    steps, state = envs.episode_steps.copy(), envs.batch.save_state()
    after, _ = envs.reset(options={"reset_mask": done})
    assert np.array_equal(after[~done], observation[~done]) and not np.array_equal(after[done], observation[done])
    assert not envs.episode_steps[done].any() and (envs.episode_steps[~done] == steps[~done]).all()
    assert envs.batch.save_state() != state
    envs.step(actions_of(step, 4))
    assert (envs.episode_steps[~done] == steps[~done] + 1).all()


def test_reset_mask_is_judged() -> None:
    envs = make(3)
    with pytest.raises(ResetNeeded, match="call reset"):
        envs.reset(options={"reset_mask": np.array([True, False, False])})
    envs.reset(seed=0)
    for mask, error, words in (
        ([True, False, False], TypeError, "a list; a NumPy array of bool"),
        (np.ones(3), TypeError, "array of float64"),
        (np.ones(4, bool), ValueError, r"shape \(4,\); it must be \(3,\)"),
        (np.zeros(3, bool), ValueError, "no True"),
    ):
        with pytest.raises(error, match=words):
            envs.reset(options={"reset_mask": mask})


def test_steps_before_reset_and_after_close_are_refused() -> None:
    envs = make(2)
    with pytest.raises(ResetNeeded, match="reset"):
        envs.step(np.zeros((2, 12), np.float32))
    envs.close()
    envs.close()
    with pytest.raises(ClosedEnvironmentError, match="closed"):
        envs.reset()


def test_gymnasiums_processes_take_it() -> None:
    vector = gymnasium.make_vec(ID, num_envs=2, vectorization_mode="async", config=lively())
    native = make(2)
    assert np.array_equal(native.reset(seed=[4, 5])[0], vector.reset(seed=4)[0])
    assert_same_steps(run(native, 5), run(vector, 5))
    vector.close()


def test_batch_in_double_precision_takes_and_gives_float32() -> None:
    envs, double = make(3), make(3, dtype="float64", num_threads=2)
    assert double.batch.dtype == np.float64 and double.single_observation_space == envs.single_observation_space
    envs.reset(seed=2)
    double.reset(seed=2)
    for step in range(3):
        result, wanted = double.step(actions_of(step, 3)), envs.step(actions_of(step, 3))
        assert result[0].dtype == result[1].dtype == np.float32
        assert np.allclose(result[0], wanted[0], atol=1e-2) and np.allclose(result[1], wanted[1], atol=1e-2)


@pytest.mark.parametrize("mode", MODES)
def test_gymnasiums_wrappers_take_it(mode: AutoresetMode) -> None:
    envs = wrappers.RecordEpisodeStatistics(make(4, mode))
    envs = wrappers.NormalizeReward(envs)
    if mode is AutoresetMode.NEXT_STEP:  # the only mode that it takes
        envs = wrappers.NormalizeObservation(envs)
    envs = wrappers.DictInfoToList(envs)
    envs.reset(seed=0)
    infos = [info for result in run(envs, 30) for info in result[4]]
    ended = [info for info in infos if "episode" in info]
    assert len(infos) == 120 and len(ended) >= 4 and all(info["episode"]["l"] > 0 for info in ended)


def test_sums_of_reward_terms_are_the_return() -> None:
    envs = make(4, AutoresetMode.SAME_STEP)
    envs.reset(seed=9)
    returns, ends = np.zeros(4), 0
    for step in range(60):
        _, reward, terminated, truncated, infos = envs.step(actions_of(step, 4))
        returns += reward
        done = terminated | truncated
        if done.any():
            terms = infos["final_info"]["reward_terms"]
            assert set(envs.config.rewards) == {name for name in terms if not name.startswith("_")}
            total = sum(terms[name] for name in envs.config.rewards)
            assert np.allclose(total[done], returns[done], atol=1e-4)
            causes = infos["final_info"]["termination_terms"]
            assert ((causes["base_contact"] | causes["tilt"])[done] == terminated[done]).all()
            returns[done], ends = 0.0, ends + done.sum()
    assert ends > 4


# Seeds


@pytest.mark.parametrize("mode", MODES)
def test_same_seed_gives_the_same_bits_for_any_number_of_environments(mode: AutoresetMode) -> None:
    few, many, again = make(3, mode), make(9, mode), make(9, mode)
    observation, _ = few.reset(seed=21)
    assert np.array_equal(observation, many.reset(seed=21)[0][:3])
    again.reset(seed=21)
    a, b, c = run(few, 50), run(many, 50, 3), run(again, 50, 3)
    assert_same_steps(a, b)
    assert_same_steps(b, c)


def test_seeds_and_environments_differ_from_each_other() -> None:
    envs = make(6)
    first, _ = envs.reset(seed=1)
    second, _ = envs.reset()
    other, _ = envs.reset(seed=2)
    rows = np.concatenate([first, second, other])
    assert len(np.unique(rows, axis=0)) == 18
    assert np.array_equal(envs.reset(seed=1)[0], first) and np.array_equal(envs.reset()[0], second)


def test_seed_of_an_unseeded_environment_can_be_asked_for() -> None:
    for envs in (make(2), gymnasium.make(ID)):
        first, _ = envs.reset()
        assert np.array_equal(envs.reset(seed=envs.unwrapped.np_random_seed)[0], first)


def test_single_environment_draws_what_the_first_of_many_draws() -> None:
    first, _ = gymnasium.make(ID).reset(seed=8)
    assert np.array_equal(first, gymnasium.make_vec(ID, num_envs=3).reset(seed=8)[0][0])


def test_seed_per_environment_leaves_out_none() -> None:
    envs = make(3)
    with pytest.raises(ValueError, match=r"seed\[1\] is None"):
        envs.reset(seed=[1, None, 3])
    first, _ = envs.reset(seed=[1, 2, 3])
    second, _ = envs.reset(seed=[1, None, 3])
    assert np.array_equal(first[[0, 2]], second[[0, 2]]) and not np.array_equal(first[1], second[1])


@pytest.mark.parametrize(
    ("seed", "error", "words"),
    [
        (-1, ValueError, "seed is -1"),
        (1.5, TypeError, "seed is 1.5; an integer"),
        ("7", TypeError, "seed is '7'; an integer"),
        ([1, 2], ValueError, "2 elements; it must be one integer or 3"),
        ([1, 2, -3], ValueError, r"seed\[2\] is -3"),
    ],
)
def test_bad_seed_is_named(seed: Any, error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        make(3).reset(seed=seed)


# Bad actions


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
@pytest.mark.parametrize("mode", MODES)
def test_action_that_is_not_finite_ends_that_episode_only(mode: AutoresetMode, bad: float) -> None:
    envs, clean = make(4, mode), make(4, mode)
    envs.reset(seed=31)
    clean.reset(seed=31)
    for step in range(3):
        envs.step(0.3 * actions_of(step, 4))
        clean.step(0.3 * actions_of(step, 4))
    actions = 0.3 * actions_of(3, 4).astype(np.float64)
    wanted = clean.step(actions)
    actions[2, 5] = bad
    observation, reward, terminated, truncated, infos = envs.step(actions)
    assert terminated.tolist() == [False, False, True, False] and not truncated.any() and reward[2] == 0.0
    assert (infos["invalid_action"] == terminated).all() and (infos["_invalid_action"] == terminated).all()
    assert np.isfinite(observation).all()
    others = [0, 1, 3]
    assert np.array_equal(observation[others], wanted[0][others]) and np.array_equal(reward[others], wanted[1][others])
    if mode is AutoresetMode.SAME_STEP:
        assert infos["final_info"]["invalid_action"].tolist() == terminated.tolist()
        assert np.isfinite(infos["final_obs"][2]).all()
    if mode is AutoresetMode.DISABLED:
        envs.reset(options={"reset_mask": terminated})
    for step in range(4, 8):
        observation, *_, infos = envs.step(0.3 * actions_of(step, 4))
        assert np.isfinite(observation).all() and "invalid_action" not in infos
        assert np.array_equal(observation[others], clean.step(0.3 * actions_of(step, 4))[0][others])


def test_single_environment_tells_of_a_bad_action() -> None:
    env = gymnasium.make(ID, disable_env_checker=True)
    env.reset(seed=0)
    _, reward, terminated, _, info = env.step(np.full(12, np.nan, np.float32))
    assert terminated and reward == 0.0 and info["invalid_action"] is True


def test_state_that_is_not_finite_ends_that_episode_only() -> None:
    envs = make(3, AutoresetMode.SAME_STEP)
    envs.reset(seed=1)
    envs.batch.generalized_force[1, 7] = np.nan
    observation, reward, terminated, _, infos = envs.step(np.zeros((3, 12), np.float32))
    assert terminated.tolist() == [False, True, False] and reward[1] == 0.0
    assert infos["non_finite"].tolist() == terminated.tolist() and np.isfinite(observation).all()


@pytest.mark.parametrize(
    ("actions", "error", "words"),
    [
        (np.zeros((2, 12)), ValueError, r"actions has shape \(2, 12\); it must be \(3, 12\)"),
        (np.zeros(12), ValueError, r"shape \(12,\)"),
        (np.zeros((3, 12), complex), TypeError, "actions holds complex128"),
        (np.zeros((3, 12), bool), TypeError, "actions holds bool"),
        ([[0.0], [0.0, 1.0], [2.0]], ValueError, "actions"),
        ("stand", TypeError, "actions"),
        (None, TypeError, "actions"),
    ],
)
def test_wrong_actions_are_named(actions: Any, error: type, words: str) -> None:
    envs = make(3)
    envs.reset(seed=0)
    with pytest.raises(error, match=words):
        envs.step(actions)
    envs.step(np.zeros((3, 12)))


def test_wrong_single_action_is_named() -> None:
    env = gymnasium.make(ID, disable_env_checker=True)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"action has shape \(5,\); it must be \(12,\)"):
        env.step(np.zeros(5))


def test_actions_of_other_number_formats_are_taken() -> None:
    results = []
    for actions in (np.ones((2, 12)), np.ones((2, 12), np.float16), np.ones((2, 12), int), [[1.0] * 12] * 2):
        envs = make(2)
        envs.reset(seed=0)
        results.append(envs.step(actions))
    assert_same_steps(results[:1] * 3, results[1:])


def test_actions_are_clipped_to_their_space() -> None:
    envs = make(1, config=AnymalFlatConfig(action_limit=1.5))
    envs.reset(seed=0)
    envs.step(np.full((1, 12), 9.0))
    assert (envs.actions == 1.5).all() and np.allclose(envs.batch.pd_target[0], envs.default_angles + 0.75)


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"num_envs": 0}, ValueError, "num_envs is 0"),
        ({"autoreset_mode": "Never"}, ValueError, "autoreset_mode is 'Never'"),
        ({"max_episode_steps": 0}, ValueError, "max_episode_steps is 0"),
        ({"render_mode": "human"}, ValueError, "render_mode is 'human'"),
        ({"config": {"kp": 3}}, TypeError, "config is a dict; an AnymalFlatConfig"),
        ({"config": AnymalFlatConfig(stance={"LF_HAA": 0.0})}, ValueError, "stance must have one angle for each"),
        ({"config": AnymalFlatConfig(rewards={"alive": rewards.alive})}, TypeError, "rewards: 'alive'"),
        (
            {"config": AnymalFlatConfig(rewards={"alive": ("much", rewards.alive)})},
            TypeError,
            "rewards: the weight of 'alive' is 'much'",
        ),
        (
            {"config": AnymalFlatConfig(observations={"speed": observations.joint_velocity})},
            TypeError,
            "observations: 'speed' is .*ObservationTerm",
        ),
        (
            {"config": AnymalFlatConfig(observations={"speed": (observations.joint_velocity, np.nan)})},
            ValueError,
            "observations: the scale of 'speed' is nan; it must be finite",
        ),
        (
            {"config": AnymalFlatConfig(observations={"speed": (observations.joint_velocity, 1.0, (1.0, 2.0))})},
            ValueError,
            r"observations: the noise of 'speed' has shape \(2,\); it must be a number, or \(12,\)",
        ),
        ({"config": AnymalFlatConfig(rewards={"alive": ("2", rewards.alive)})}, TypeError, "weight of 'alive' is '2'"),
        (
            {"config": AnymalFlatConfig(commands=Commands(left=("0", 1)))},
            TypeError,
            "commands.left is .'0', 1.; a pair",
        ),
        ({"config": AnymalFlatConfig(observation_limit=-1.0)}, ValueError, "observation_limit is -1.0; it must be"),
        ({"config": AnymalFlatConfig(randomization=None)}, TypeError, "randomization is a NoneType; a dict"),
        (
            {"config": AnymalFlatConfig(randomization={"mass": 3.0})},
            TypeError,
            "randomization: 'mass' is 3.0; a function",
        ),
        (
            {"config": AnymalFlatConfig(terminations={"fall": None})},
            TypeError,
            "terminations: 'fall' is None; a function",
        ),
        ({"config": AnymalFlatConfig(initial_state=None)}, TypeError, "initial_state is None; a function"),
        ({"config": AnymalFlatConfig(action_limit=0.0)}, ValueError, "action_limit is 0.0; it must be positive"),
        ({"config": AnymalFlatConfig(action_scale=np.nan)}, ValueError, "action_scale is nan; it must be finite"),
        ({"config": AnymalFlatConfig(commands={"forward": (0, 1)})}, TypeError, "commands is a dict; a .*Commands is"),
        (
            {"config": AnymalFlatConfig(commands=Commands(left=(1, -1)))},
            ValueError,
            "commands.left is .1.0, -1.0.; low",
        ),
        ({"config": AnymalFlatConfig(commands=Commands(yaw_rate=1.0))}, TypeError, "commands.yaw_rate is 1.0; a pair"),
        (
            {"config": AnymalFlatConfig(commands=Commands(forward=(0, np.inf)))},
            ValueError,
            "commands.forward .* finite",
        ),
        (
            {"config": AnymalFlatConfig(commands=Commands(seconds=0.0))},
            ValueError,
            "commands.seconds is 0.0; it must be",
        ),
        ({"config": AnymalFlatConfig(pushes=5.0)}, TypeError, "pushes is a float; a .*Pushes or None is wanted"),
        ({"config": AnymalFlatConfig(pushes=Pushes(seconds=(2, 1)))}, ValueError, "pushes.seconds is .2.0, 1.0.; low"),
        (
            {"config": AnymalFlatConfig(pushes=Pushes(seconds=(0, 1)))},
            ValueError,
            "pushes.seconds is .0, 1.; it must be",
        ),
        ({"config": AnymalFlatConfig(decimation=0)}, ValueError, "decimation is 0"),
        ({"config": AnymalFlatConfig(episode_seconds=np.inf)}, ValueError, "episode_seconds is inf; it must be finite"),
        (
            {"config": AnymalFlatConfig(episode_seconds=0.001)},
            ValueError,
            "episode_seconds is 0.001; an action alone lasts 0.02 s",
        ),
    ],
)
def test_wrong_options_are_named(options: dict[str, Any], error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        AnymalFlat(**options)


def test_limits_may_be_infinite() -> None:
    config = AnymalFlatConfig(action_limit=np.inf, observation_limit=np.inf)
    envs = AnymalFlat(2, config=config)
    assert np.isinf(envs.single_action_space.high).all() and np.isinf(envs.single_observation_space.high).all()
    envs.reset(seed=0)
    assert np.isfinite(envs.step(np.full((2, 12), 0.1, np.float32))[0]).all()


def test_max_episode_steps_wins_over_the_configuration() -> None:
    assert make(1, max_episode_steps=7).max_episode_steps == 7
    assert gymnasium.make_vec(ID, num_envs=1).max_episode_steps == 1000
