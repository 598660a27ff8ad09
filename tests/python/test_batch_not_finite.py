"""Environments that are not finite: flagged and set aside, and no other notices."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from batch_scenes import INTEGRATORS, NUMBERS, OUTPUTS, STANCE, anymal, assert_same_bits, run, same_bits, scattered


def poison_target(batch: ss.Batch) -> None:
    batch.pd_target[3, 5] = np.nan


def poison_force(batch: ss.Batch) -> None:
    batch.generalized_force[3, 0] = np.inf


def poison_wrench(batch: ss.Batch) -> None:
    batch.external_wrench[3, 2, 1] = np.nan


def poison_q(batch: ss.Batch) -> None:
    batch.q[3, 4] = np.nan


def poison_u(batch: ss.Batch) -> None:
    batch.u = np.where(np.arange(batch.num_envs)[:, None] == 3, -np.inf, batch.u)


def overflow(batch: ss.Batch) -> None:
    batch.generalized_force[3, 3:6] = np.finfo(batch.dtype).max


@pytest.mark.parametrize("dtype", NUMBERS)
@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("poison", [poison_target, poison_force, poison_wrench, poison_q, poison_u, overflow])
def test_poison_flags_its_environment_and_no_other(dtype: str, integrator: str, poison) -> None:
    batch, clean = (scattered(17, dtype, 2, integrator=integrator) for _ in range(2))
    for b in (batch, clean):
        b.external_wrench[:] = 0  # parameters of its own in both
        run(b, 50)
    state = batch.q[3].copy(), batch.u[3].copy()
    poison(batch)
    for call in range(10):
        status = batch.step()
        clean.step()
        assert_same_bits(batch, clean, ("q", "u", *OUTPUTS), np.arange(17) != 3)
        for name in ("q", "u", *OUTPUTS):
            assert np.isfinite(getattr(batch, name)).all(), name
        if call == 0 or poison not in (poison_q, poison_u):  # a bad state is replaced by the last finite one, once
            assert ss.StepStatus.NON_FINITE in status
            assert batch.flagged(ss.StepStatus.NON_FINITE).tolist() == [3]
            assert same_bits(batch.q[3], state[0]) and same_bits(batch.u[3], state[1])
        else:
            assert ss.StepStatus.NON_FINITE not in status


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_target_that_is_not_finite_flags_whoever_the_neighbors_are(integrator: str) -> None:
    world = anymal(integrator=integrator)
    world.robots[0].set_pd_gains(0.0, 0.0)
    outcomes = []
    for neighbor in ("plain", "gains", "force", "wrench"):
        batch = ss.Batch(world, 2)
        batch.pd_target[0, 3] = np.nan
        if neighbor == "gains":
            batch.kp[1] = 50.0
        elif neighbor == "force":
            batch.generalized_force[1, 8] = 1.0
        elif neighbor == "wrench":
            batch.external_wrench[1, 0, 2] = 1.0
        batch.step(20)
        assert not batch.contact_active[0].any() and not batch.contact_impulse[0].any()
        outcomes.append((int(batch.status[0]), batch.q[0].tobytes(), batch.u[0].tobytes()))
    assert outcomes[0][0] == int(ss.StepStatus.NON_FINITE)
    assert all(outcome == outcomes[0] for outcome in outcomes)


def test_state_that_is_none_is_set_aside_for_the_whole_call() -> None:
    # Long calls are cut into parts, more of them for more environments.
    outcomes = []
    for num_envs in (1, 1024):
        batch = ss.Batch(anymal(), num_envs)
        batch.step(600)
        assert batch.contact_active[0].any()
        batch.q[0, 2] = np.nan
        assert ss.StepStatus.NON_FINITE in batch.step(600)
        assert not batch.contact_active[0].any() and not batch.contact_impulse[0].any()
        outcomes.append((int(batch.status[0]), float(batch.time[0]), batch.q[0].tobytes()))
    assert outcomes[0] == outcomes[1]
    assert outcomes[0][0] == int(ss.StepStatus.NON_FINITE)


@pytest.mark.parametrize("dtype", NUMBERS)
def test_flagged_environment_lives_again_after_a_reset(dtype: str) -> None:
    batch, fresh = ss.Batch(anymal(), 5, dtype), ss.Batch(anymal(), 5, dtype)
    batch.pd_target[2, 0] = np.nan
    batch.step(10)
    batch.pd_target[2] = STANCE
    batch.reset(batch.flagged(ss.StepStatus.NON_FINITE))
    assert not batch.status[2] and not batch.time[2]
    assert batch.step(10) == fresh.step(10) == ss.StepStatus.OK
    assert_same_bits(batch, fresh, ("q", "u", *OUTPUTS), 2)
