"""A task seen by rsl_rl: shapes, time limits, what is logged, a few iterations of training, the policy without torch."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

import stickslip as ss

torch = pytest.importorskip("torch")
runners = pytest.importorskip("rsl_rl.runners")
if not hasattr(ss, "Batch"):
    pytest.skip("needs stickslip.Batch", allow_module_level=True)

from stickslip.envs import AnymalFlat, AnymalFlatConfig  # noqa: E402
from stickslip.envs.rsl_rl import RslRlVecEnv, policy_of  # noqa: E402

MODEL = {"class_name": "MLPModel", "hidden_dims": [16, 8], "activation": "elu", "obs_normalization": True}
TRAINING = {
    "num_steps_per_env": 4,
    "save_interval": 1000,
    "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
    "actor": MODEL | {"distribution_cfg": {"class_name": "GaussianDistribution", "init_std": 0.5}},
    "critic": MODEL,
    "algorithm": {"class_name": "PPO", "num_learning_epochs": 2, "num_mini_batches": 2},
}


def adapted(num_envs: int = 6, **options) -> RslRlVecEnv:
    config = AnymalFlatConfig(randomization={}, pushes=None)
    task = gymnasium.make_vec(
        "stickslip/AnymalFlat-v0",
        num_envs=num_envs,
        autoreset_mode="SameStep",
        config=config,
        max_episode_steps=options.pop("max_episode_steps", None),
    )
    return RslRlVecEnv(task, seed=0, **options)


def test_it_says_what_rsl_rl_asks_for() -> None:
    env = adapted()
    assert (env.num_envs, env.num_actions, env.max_episode_length, env.device) == (6, 12, 1000, "cpu")
    observations = env.get_observations()
    assert observations["policy"].shape == (6, 48) and observations["policy"].dtype == torch.float32
    observations, rewards, dones, extras = env.step(torch.zeros(6, 12))
    assert observations.batch_size == rewards.shape == dones.shape == extras["time_outs"].shape == (6,)
    assert rewards.dtype == torch.float32 and dones.dtype == extras["time_outs"].dtype == torch.bool


def test_steps_are_those_of_the_task() -> None:
    env, task = adapted(), AnymalFlat(6, config=AnymalFlatConfig(randomization={}, pushes=None))
    observation, _ = task.reset(seed=0)
    np.testing.assert_array_equal(env.get_observations()["policy"], observation)
    actions = np.random.default_rng(0).normal(size=(6, 12)).astype(np.float32)
    observations, rewards, *_ = env.step(torch.from_numpy(actions))
    expected, reward, *_ = task.step(actions)
    np.testing.assert_array_equal(observations["policy"], expected)
    np.testing.assert_array_equal(rewards, reward)


def test_a_stored_observation_is_not_overwritten_by_the_next_step() -> None:
    env = adapted()
    observations = env.get_observations()
    before = observations["policy"].clone()
    env.step(torch.ones(6, 12))
    assert torch.equal(observations["policy"], before)


def test_time_limits_are_not_falls() -> None:
    env = adapted(max_episode_steps=3)
    results = [env.step(torch.zeros(6, 12)) for _ in range(3)]
    for _, _, dones, extras in results[:2]:
        assert not dones.any() and not extras["time_outs"].any() and extras["log"] == {}
    _, _, dones, extras = results[2]
    assert dones.all() and extras["time_outs"].all() and extras["log"]["/fallen"] == 0
    assert (env.episode_length_buf == 0).all(), "the next episodes have begun"


def test_an_episode_that_ends_early_is_no_time_out() -> None:
    env = adapted()
    actions = torch.zeros(6, 12)
    actions[2] = torch.nan
    _, rewards, dones, extras = env.step(actions)
    assert dones.tolist() == [False, False, True, False, False, False]
    assert not extras["time_outs"].any() and extras["log"]["/fallen"] == 1 and rewards[2] == 0


def test_reward_terms_are_logged_per_second() -> None:
    env = adapted(max_episode_steps=2)
    _, first, *_ = env.step(torch.zeros(6, 12))
    _, last, _, extras = env.step(torch.zeros(6, 12))
    terms = [value for name, value in extras["log"].items() if name.startswith("/reward/")]
    assert len(terms) == len(env.task.config.rewards)
    assert sum(terms) == pytest.approx((first + last).mean().item() / (2 * env.task.step_seconds), rel=1e-4)


def test_metrics_see_the_task_after_each_step() -> None:
    env = adapted(metrics=lambda task: {"/height": float(task.state.base_height.mean())})
    *_, extras = env.step(torch.zeros(6, 12))
    assert extras["log"]["/height"] == pytest.approx(env.task.batch.q[:, 2].mean(), rel=1e-5)


def test_rsl_rl_can_stagger_episodes() -> None:
    env = adapted()
    env.episode_length_buf = torch.tensor([0, 10, 20, 30, 40, 999])
    assert env.task.episode_steps.tolist() == [0, 10, 20, 30, 40, 999]
    _, _, dones, extras = env.step(torch.zeros(6, 12))
    assert dones.tolist() == extras["time_outs"].tolist() == [False] * 5 + [True]


def test_a_few_iterations_train_and_the_policy_needs_no_torch() -> None:
    torch.manual_seed(0)
    env = adapted(16)
    runner = runners.OnPolicyRunner(env, dict(TRAINING))
    before = policy_of(runner)
    runner.learn(3, init_at_random_ep_len=True)
    policy = policy_of(runner)
    assert not np.array_equal(before.weights[0], policy.weights[0]) and (policy.mean != 0).any()
    observations = env.get_observations()
    with torch.inference_mode():
        wanted = runner.get_inference_policy()(observations)
    np.testing.assert_allclose(policy(observations["policy"].numpy()), wanted, rtol=1e-4, atol=1e-5)


def test_other_modes_and_other_environments_are_refused() -> None:
    with pytest.raises(ValueError, match=r'autoreset_mode is "NextStep"; rsl_rl expects "SameStep"'):
        RslRlVecEnv(gymnasium.make_vec("stickslip/AnymalFlat-v0", num_envs=2))
    with pytest.raises(TypeError, match=r"task is a SyncVectorEnv; a stickslip\.envs\.VectorTask is wanted"):
        RslRlVecEnv(gymnasium.make_vec("CartPole-v1", num_envs=2, vectorization_mode="sync"))
