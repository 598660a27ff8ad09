"""What AnymalFlat observes, rewards, commands and randomizes; how users replace it."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stickslip as ss
from env_runs import actions_of, make
from stickslip.envs import (
    AnymalFlat,
    AnymalFlatConfig,
    LocomotionState,
    RandomStreams,
    commands,
    observations,
    randomization,
    rewards,
    terminations,
)

if not hasattr(ss, "Batch"):
    pytest.skip("needs stickslip.Batch", allow_module_level=True)

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "envs.md").read_text(encoding="utf-8")


def quiet(**options: Any) -> AnymalFlatConfig:
    """Nothing is random but the heading."""
    return AnymalFlatConfig(
        initial_state=partial(randomization.initial_state, joint_scale=(1.0, 1.0), speed=0.0),
        randomization={},
        pushes=None,
        commands=commands.Commands((0.0, 0.0), (0.0, 0.0), (0.0, 0.0)),
        **options,
    )


def test_observation_is_the_state_in_base_axes() -> None:
    envs = make(5, config=AnymalFlatConfig())
    envs.reset(seed=6)
    for step in range(5):
        observation, *_ = envs.step(actions_of(step, 5))
    q, u = envs.batch.q, envs.batch.u
    to_base = Rotation.from_quat(q[:, [4, 5, 6, 3]]).inv()
    wanted = np.concatenate(
        [
            2.0 * to_base.apply(u[:, :3]),
            0.25 * to_base.apply(u[:, 3:6]),
            to_base.apply([0.0, 0.0, -1.0]),
            envs.commands * [2.0, 2.0, 0.25],
            q[:, 7:] - envs.default_angles,
            0.05 * u[:, 6:],
            actions_of(4, 5),
        ],
        axis=1,
    )
    assert np.allclose(observation, wanted, atol=2e-5)


def test_noise_stays_in_its_bounds_and_is_off_by_default() -> None:
    clean, _ = make(4, config=quiet()).reset(seed=2)
    noisy, _ = make(4, config=quiet(observation_noise=True)).reset(seed=2)
    terms = observations.default_observations().values()
    sizes = (3, 3, 3, 3, 12, 12, 12)
    bounds = [np.broadcast_to(np.multiply(t.scale, t.noise), n) for t, n in zip(terms, sizes, strict=True)]
    bound = np.concatenate(bounds)
    assert (np.abs(noisy - clean) <= bound + 1e-6).all()
    assert ((noisy != clean).all(axis=0) == (bound > 0)).all()


def test_standing_robots_stand_for_a_whole_episode() -> None:
    envs = make(2, config=quiet(episode_seconds=5.0))
    envs.reset(seed=0)
    for _ in range(250):
        _, reward, terminated, truncated, _ = envs.step(np.zeros((2, 12), np.float32))
        assert not terminated.any()
    assert truncated.all() and np.allclose(reward, 1.5 * envs.step_seconds, rtol=0.05)
    assert envs.state.foot_contact.all() and np.allclose(envs.state.base_height, 0.48, atol=0.02)


def state_of(num_envs: int = 2, **arrays: Any) -> LocomotionState:
    state = LocomotionState.zeros(num_envs, 12, 4, step_seconds=0.02, kp=80.0, kd=2.0)
    for name, value in arrays.items():
        getattr(state, name)[:] = value
    return state


def test_reward_terms_follow_their_formulas() -> None:
    state = state_of(commands=[1.0, 0.5, -0.4], base_linear_velocity=[0.5, 0.5, 0.3])
    state.base_angular_velocity[:] = [1.0, 2.0, 0.6]
    assert np.allclose(rewards.track_linear_velocity(state), np.exp(-0.25 / 0.25))
    assert np.allclose(rewards.track_linear_velocity(state, variance=0.5), np.exp(-0.25 / 0.5))
    assert np.allclose(rewards.track_yaw_rate(state), np.exp(-1.0 / 0.25))
    assert np.allclose(rewards.vertical_velocity(state), 0.09)
    assert np.allclose(rewards.roll_pitch_rate(state), 5.0)
    state = state_of(joint_target=0.2, joint_position=0.1, joint_velocity=0.5, previous_joint_velocity=0.3)
    assert np.allclose(rewards.joint_torque(state), 12 * (80 * 0.1 - 2 * 0.5) ** 2)
    assert np.allclose(rewards.joint_acceleration(state), 12 * (0.2 / 0.02) ** 2, rtol=1e-5)
    assert np.allclose(rewards.joint_deviation(state), 1.2) and np.allclose(rewards.stand_still(state), 1.2)
    state = state_of(actions=0.5, previous_actions=-0.5, projected_gravity=[0.6, 0.0, -0.8], base_height=0.4)
    assert np.allclose(rewards.action_rate(state), 12.0) and np.allclose(rewards.orientation(state), 0.36)
    assert np.allclose(rewards.base_height(state, target=0.5), 0.01) and (rewards.alive(state) == 1).all()
    state = state_of(commands=[[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], foot_air_time=[0.7, 0.4, 0.6, 0.6])
    state.foot_touchdown[:] = [True, True, False, False]
    assert np.allclose(rewards.feet_air_time(state), [0.1, 0.0], atol=1e-6)


def test_terminations_see_tilt_and_height() -> None:
    state = state_of(projected_gravity=[[np.sin(0.9), 0.0, -np.cos(0.9)], [0.0, np.sin(1.1), -np.cos(1.1)]])
    state.base_height[:] = [0.5, 0.1]
    assert terminations.tilt(state).tolist() == [False, True]
    assert terminations.tilt(state, largest=0.5).all()
    assert terminations.low_base(state).tolist() == [False, True]


def test_base_on_the_ground_ends_the_episode() -> None:
    def lying(task: AnymalFlat, envs: np.ndarray) -> tuple:
        q, u = randomization.initial_state(task, envs, speed=0.0)
        q[:, 2], q[:, 7:] = 0.05, [0.0, np.pi, 0.0] * 4  # a centimeter above the ground, legs upward
        return q, u

    envs = make(2, config=AnymalFlatConfig(initial_state=lying, kp=0.0, kd=0.0, pushes=None))
    envs.reset(seed=0)
    for _ in range(5):
        _, _, terminated, _, infos = envs.step(np.zeros((2, 12), np.float32))
        if terminated.any():
            break
    causes = infos["termination_terms"]
    assert terminated.all() and causes["base_contact"].all() and not causes["tilt"].any()


def test_air_time_counts_from_takeoff_to_touchdown() -> None:
    envs = make(1, config=quiet())
    envs.reset(seed=0)
    state, columns, impulse = envs.state, envs._columns, np.zeros_like(envs.batch.contact_impulse)
    touch = np.zeros((1, 4), bool)
    seen = []
    for contact in (0, 0, 1, 1, 0, 0, 0, 1, 1, 0):
        for points in columns.feet:
            impulse[:, points, 2] = contact
        state.measure_contacts(impulse, columns)
        touch |= state.foot_touchdown
        seen.append((bool(state.foot_touchdown[0, 0]), round(float(state.foot_air_time[0, 0]) / 0.02)))
    # In the air for 3 steps: the swing that is told at touchdown spans 4 control steps, from the last contact to the next.
    assert [step for step, (touchdown, _) in enumerate(seen) if touchdown] == [2, 7]
    assert seen[7] == (True, 4) and touch.all()


def test_commands_lie_in_their_ranges() -> None:
    streams = RandomStreams(2000)
    streams.seed(5)
    wanted = commands.Commands((-0.5, 1.0), (-0.2, 0.3), (-2.0, 2.0), standing=0.1)
    drawn = commands.uniform_commands(streams, slice(None), wanted)
    low, high = [-0.5, -0.2, -2.0], [1.0, 0.3, 2.0]
    assert (drawn >= low).all() and (drawn <= high).all() and np.allclose(drawn.max(axis=0), high, atol=0.02)
    speed = np.hypot(drawn[:, 0], drawn[:, 1])
    assert ((speed == 0) | (speed >= wanted.least_speed)).all()
    assert 0.07 < (drawn == 0).all(axis=1).mean() < 0.13


def test_commands_change_when_their_time_is_over() -> None:
    envs = make(3, config=AnymalFlatConfig(commands=commands.Commands(seconds=0.1), pushes=None))
    envs.reset(seed=0)
    last, changes = envs.commands.copy(), []
    for _ in range(12):
        envs.step(np.zeros((3, 12), np.float32))
        changes.append((envs.commands != last).any())
        last = envs.commands.copy()
    assert np.flatnonzero(changes).tolist() == [4, 9]


@pytest.mark.parametrize("seconds", [1e12, np.inf])
def test_long_intervals_mean_never(seconds: float) -> None:
    config = quiet()
    config.commands = commands.Commands(seconds=seconds)
    config.pushes = randomization.Pushes(seconds=(seconds, seconds))
    envs = make(3, config=config)
    envs.reset(seed=0)
    assert (envs._command_steps > 2**30).all() and (envs._push_steps > 2**30).all()
    drawn = envs.commands.copy()
    envs.step(np.zeros((3, 12)))
    assert (envs.commands == drawn).all()


def test_torque_is_of_the_gains_of_each_environment() -> None:
    envs = make(2, config=quiet())
    envs.reset(seed=0)
    envs.step(np.ones((2, 12)))
    assert not envs.batch.has_own("kp") and envs.state.kp == 80.0
    envs.batch.kp[1] = 40.0
    envs.batch.kd[1] = 1.0
    envs.step(np.ones((2, 12)))
    state = envs.state
    error = state.joint_target - state.joint_position
    assert np.allclose(state.joint_torque[0], 80.0 * error[0] - 2.0 * state.joint_velocity[0], atol=1e-4)
    assert np.allclose(state.joint_torque[1], 40.0 * error[1] - state.joint_velocity[1], atol=1e-4)
    assert state.rows(np.array([1])).joint_torque.shape == (1, 12)


def test_each_episode_draws_friction_and_mass() -> None:
    envs = make(50, config=AnymalFlatConfig())
    envs.reset(seed=0)
    friction, mass, inertia = (a.copy() for a in (envs.batch.friction, envs.batch.body_mass, envs.batch.body_inertia))
    base = envs.batch.model.bodies[0]
    assert (friction == friction[:, :1]).all() and friction.min() >= 0.5 and friction.max() <= 1.25
    added = mass[:, 0] - base.mass
    assert added.min() < -3 and added.max() > 3 and np.abs(added).max() <= 5.0 + 1e-5
    assert np.allclose(inertia[:, 0], mass[:, :1] / base.mass * base.inertia[np.triu_indices(3)], rtol=1e-5)
    assert (mass[:, 1:] == mass[:1, 1:]).all()
    envs.reset(options={"reset_mask": np.arange(50) < 20})
    changed = (envs.batch.friction != friction).any(axis=1)
    assert changed[:20].all() and not changed[20:].any()


@pytest.mark.parametrize(
    ("term", "words"),
    [
        (partial(randomization.friction, low=-0.1), "friction: low is -0.1; it must be zero or positive"),
        (partial(randomization.friction, low=2.0), r"friction: \(low, high\) is .*; low must not exceed high"),
        (partial(randomization.base_mass, low=-50.0), r"base_mass: low is -50\.0; the base has \d+\.\d+ kg"),
        (partial(randomization.base_mass, high=np.nan), r"base_mass: \(low, high\) is"),
        (partial(randomization.base_mass, high=np.inf), "base_mass: high is inf; it must be finite"),
        (partial(randomization.friction, high=np.inf), "friction: high is inf; it must be finite"),
    ],
)
def test_randomization_that_no_robot_can_have_is_named(term: Any, words: str) -> None:
    envs = make(2, config=AnymalFlatConfig(randomization={"term": term}))
    with pytest.raises(ValueError, match=words):
        envs.reset(seed=0)


def test_pushes_come_at_drawn_times() -> None:
    pushed: list[np.ndarray] = []

    def push(task: AnymalFlat, envs: np.ndarray) -> None:
        pushed.append(envs.copy())
        before = task.batch.u[envs].copy()
        randomization.push(task, envs)
        change = task.batch.u[envs] - before
        assert (np.abs(change[:, :2]) <= 0.5).all() and change[:, :2].any() and not change[:, 2:].any()

    config = quiet()
    config.pushes = randomization.Pushes((0.1, 0.2), push)
    envs = make(4, config=config)
    envs.reset(seed=0)
    for _ in range(40):
        envs.step(np.zeros((4, 12), np.float32))
    times = np.bincount(np.concatenate(pushed), minlength=4)
    assert (times >= 4).all() and (times <= 8).all()


def test_user_replaces_terms_by_configuration() -> None:
    config = quiet(
        observations={"height": observations.ObservationTerm(lambda state: state.base_height[:, None], 10.0)},
        rewards={"high": (2.0, lambda state: state.base_height)},
        terminations={"high": lambda state: state.base_height > 0.55},
        draw_commands=lambda random, envs, wanted: np.full((len(envs), 3), 0.25),
    )
    envs = make(2, config=config)
    observation, _ = envs.reset(seed=0)
    assert observation.shape == (2, 1) and np.allclose(observation, 6.0) and (envs.commands == 0.25).all()
    _, reward, terminated, _, infos = envs.step(np.zeros((2, 12), np.float32))
    assert np.allclose(reward, 2.0 * 0.02 * envs.batch.q[:, 2]) and terminated.all()
    assert np.allclose(infos["reward_terms"]["high"], reward)


def test_reward_of_another_shape_is_named() -> None:
    for term in (lambda state: 1.0, lambda state: state.commands):
        envs = make(2, config=quiet(rewards={"odd": (1.0, term)}))
        envs.reset(seed=0)
        with pytest.raises(ValueError, match=r"rewards\(\): 'odd' has shape .*; it must be \(2,\)"):
            envs.step(np.zeros((2, 12), np.float32))


def test_only_positive_rewards_cuts_at_zero() -> None:
    for only in (False, True):
        envs = make(2, config=quiet(rewards={"bad": (-1.0, rewards.alive)}, only_positive_rewards=only))
        envs.reset(seed=0)
        reward = envs.step(np.zeros((2, 12), np.float32))[1]
        assert np.allclose(reward, 0.0 if only else -0.02)


def test_page_names_every_term() -> None:
    config = AnymalFlatConfig()
    terms = [config.observations, config.rewards, config.terminations, config.randomization]
    names = [
        *AnymalFlatConfig.__annotations__,
        *commands.Commands.__annotations__,
        *(n for group in terms for n in group),
    ]
    assert [name for name in names if f"`{name}`" not in PAGE] == []


def test_configuration_of_the_page_runs() -> None:
    code = re.findall(r"```python\n(.*?)```", PAGE, flags=re.S)[1]
    names: dict[str, Any] = {}
    exec(compile(code, "docs/envs.md", "exec"), names)
    envs = names["envs"]
    envs.reset(seed=0)
    envs.step(np.zeros((64, 12), np.float32))
    assert {"crouch", "track_linear_velocity"} < set(envs.config.rewards) and list(envs.config.terminations) == ["tilt"]
