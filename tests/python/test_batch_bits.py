"""Bits of a batch: every environment is a World of its own, whatever its neighbors, threads and calls are."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from batch_of_worlds import BatchOfWorlds
from batch_scenes import (
    INTEGRATORS,
    NUMBERS,
    OUTPUTS,
    STANCE,
    anymal,
    arm,
    assert_same_bits,
    drive,
    run,
    same_bits,
    scattered,
    scattered_states,
)

# Every environment is a World


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("time_step", [1e-3, 5e-3])
def test_float64_batch_has_the_bits_of_worlds(integrator: str, time_step: float) -> None:
    # Falling and tumbling environments beside standing ones: feet and torso touch, stick and slip.
    def make() -> ss.World:
        return anymal(integrator=integrator, time_step=time_step)

    batch, worlds = ss.Batch(make(), 6, "float64", num_threads=2), BatchOfWorlds(make, 6)
    assert_same_bits(batch, worlds, ("q", "u", "pd_target", "kp", "kd", "friction", *OUTPUTS))
    for b in (batch, worlds):
        b.reset(None, *scattered_states(6))
    feet = torso = 0
    for step in range(0, 400, 4):
        drive(batch, step)
        drive(worlds, step)
        assert batch.step(4) == worlds.step(4)
        assert_same_bits(batch, worlds, ("q", "u", *OUTPUTS), where=f"after {step + 4} steps")
        feet += (batch.contact_impulse[:, 8:, 2] > 0).sum()
        torso += (batch.contact_impulse[:, :8, 2] > 0).sum()
    assert feet > 200 and torso > 20, "hardly any contact, so it showed little"


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_fixed_base_has_the_bits_of_worlds(integrator: str) -> None:
    def make() -> ss.World:
        return arm(integrator=integrator)

    batch, worlds = ss.Batch(make(), 5, "float64"), BatchOfWorlds(make, 5)
    assert (batch.q.shape, batch.u.shape) == ((5, 2), (5, 2))
    for b in (batch, worlds):
        b.reset(None, np.linspace(-1, 1, 10).reshape(5, 2))
    touched = 0
    for _ in range(60):
        assert batch.step(10) == worlds.step(10)
        assert_same_bits(batch, worlds, ("q", "u", *OUTPUTS))
        touched += batch.contact_impulse.any()
    assert touched > 10


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_state_that_is_written_is_as_one_that_is_reset(integrator: str) -> None:
    # Warm starts and the history of the integrator are forgotten, as `Robot.set_state` does.
    batch, worlds = (
        ss.Batch(anymal(integrator=integrator), 4, "float64"),
        BatchOfWorlds(lambda: anymal(integrator=integrator), 4),
    )
    for b in (batch, worlds):
        b.step(150)
        b.q[1] = b.q[0]
        b.q[1, 3:7] = 1, 0, 0, 0
        b.u[2, 6:] += 1
        b.u[3] = 0
        b.step(100)
    assert_same_bits(batch, worlds, ("q", "u", *OUTPUTS))
    assert batch.contact_active.any(axis=1).all()


def test_float32_stays_near_float64() -> None:
    batches = [ss.Batch(anymal(), 4, dtype) for dtype in NUMBERS]
    for batch in batches:
        batch.reset(None, *scattered_states(4))
        run(batch, 100)
    np.testing.assert_allclose(batches[0].q[::2], batches[1].q[::2], rtol=0, atol=1e-3)
    assert batches[0].residual.max() < 1e-4


# Bits do not depend on the neighbors


@pytest.mark.parametrize("dtype", NUMBERS)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_number_of_environments_and_threads_and_their_pinning_change_no_bit(dtype: str, integrator: str) -> None:
    everything = scattered(33, dtype, integrator=integrator)
    run(everything, 200)
    assert everything.contact_active.any()
    for num_envs in (1, 5, 16, 17, 33):
        for num_threads, pin_threads in ((1, False), (2, False), (2, True), (3, True)):
            batch = scattered(num_envs, dtype, num_threads, pin_threads, integrator=integrator)
            run(batch, 200)
            assert_same_bits(
                batch,
                everything,
                ("q", "u", *OUTPUTS),
                slice(num_envs),
                f"{num_envs}, {num_threads} threads, {pin_threads=}",
            )


@pytest.mark.parametrize("dtype", NUMBERS)
def test_order_of_environments_changes_no_bit(dtype: str) -> None:
    batch, turned = (ss.Batch(anymal(), 19, dtype) for _ in range(2))
    q, u = scattered_states(19)
    batch.reset(None, q, u)
    turned.reset(None, q[::-1], u[::-1])
    batch.step(200)
    turned.step(200)
    for name in ("q", "u", *OUTPUTS):
        assert same_bits(getattr(batch, name), getattr(turned, name)[::-1]), name


@pytest.mark.parametrize("dtype", NUMBERS)
def test_neighbor_that_needs_substeps_changes_nobodys_contacts(dtype: str) -> None:
    batch, calm = (ss.Batch(anymal(time_step=5e-3), 16, dtype, 1) for _ in range(2))
    for b in (batch, calm):
        b.step(200)
    q, u = batch.q[3].copy(), batch.u[3].copy()
    q[2], u[3] = 5.0, 200.0  # in the air, and so fast that its step is cut
    batch.reset([3], q=q, u=u)
    others = np.arange(16) != 3
    for _ in range(10):
        batch.step()
        calm.step()
        assert_same_bits(batch, calm, ("q", "u", *OUTPUTS), others)
        assert batch.contact_active[others].any(axis=1).all() and not batch.contact_active[3].any()


@pytest.mark.parametrize("dtype", NUMBERS)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_instruction_sets_change_no_bit(dtype: str, integrator: str, monkeypatch) -> None:
    widest = scattered(17, dtype, integrator=integrator)
    run(widest, 200)
    tried = []
    for name in ("avx512", "avx2", "neon"):
        monkeypatch.setenv("STICKSLIP_ISA", name)
        try:
            batch = scattered(17, dtype, integrator=integrator)
        except ss.ModelError as error:
            assert name in str(error)
            continue
        assert batch.instruction_set == name
        run(batch, 200)
        assert_same_bits(batch, widest, ("q", "u", *OUTPUTS), where=name)
        tried.append(name)
    assert widest.instruction_set in tried


@pytest.mark.parametrize("dtype", NUMBERS)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_regrouping_changes_no_bit(dtype: str, integrator: str) -> None:
    # Parameters, resets and saved states must find environments wherever they are.
    def make(regroup_every: int) -> ss.Batch:
        batch = ss.Batch(anymal(integrator=integrator), 45, dtype, 2, regroup_every=regroup_every)
        batch.reset(None, *scattered_states(45))
        batch.body_mass[:, 0] *= np.linspace(0.9, 1.1, 45)
        batch.friction[:] = np.linspace(0.3, 1.0, 45)[:, None]
        batch.external_wrench[::3, 0, 1] = 20
        batch.generalized_force[::4, 8] = 3
        return batch

    never, often, other = make(0), make(1), make(7)
    for part in range(6):
        for b in (never, often, other):
            run(b, 30, 30 * part)
        for b in (often, other):
            assert_same_bits(b, never, ("q", "u", *OUTPUTS))
            assert b.save_state() == never.save_state()
        assert len(np.unique(never.contact_active, axis=0)) > 6, "all touch alike, so it showed little"
        for b in (never, often, other):
            b.load_state(other.save_state())  # into places of its own
            b.reset([part, 40 - part])
            b.body_mass[7 * part, 3] *= 1.5
            b.q[9 + part, 2] += 0.1


@pytest.mark.parametrize("dtype", NUMBERS)
def test_regrouping_in_several_blocks_and_threads_changes_no_bit(dtype: str) -> None:
    # 601: the last block and the last pack are not full.
    def make(num_threads: int, regroup_every: int) -> ss.Batch:
        batch = ss.Batch(anymal(), 601, dtype, num_threads, regroup_every=regroup_every)
        batch.reset(None, *scattered_states(601))
        batch.body_mass[:, 0] *= np.linspace(0.9, 1.1, 601)
        return batch

    never, often = make(1, 0), make(3, 1)
    for part in range(4):
        for b in (never, often):
            run(b, 30, 30 * part)
            b.step(20)  # is cut
            b.reset(np.arange(part, 601, 50))
        assert_same_bits(often, never, ("q", "u", *OUTPUTS))
    assert len(np.unique(never.contact_active, axis=0)) > 20


@pytest.mark.parametrize("dtype", NUMBERS)
def test_environment_that_is_set_aside_may_change_its_lane_within_a_call(dtype: str) -> None:
    never, often = (ss.Batch(anymal(), 45, dtype, regroup_every=every) for every in (0, 1))
    for b in (never, often):
        b.reset(None, *scattered_states(45))
        run(b, 60)
        b.q[21, 2] = np.nan
        assert ss.StepStatus.NON_FINITE in b.step(40)
        assert b.flagged(ss.StepStatus.NON_FINITE).tolist() == [21]
    assert_same_bits(often, never, ("q", "u", *OUTPUTS))


# Many steps in a call


@pytest.mark.parametrize("dtype", NUMBERS)
def test_several_steps_at_once_are_steps_one_by_one(dtype: str) -> None:
    one, many = scattered(33, dtype), scattered(33, dtype)
    status, residual = np.zeros(33, np.uint32), np.zeros(33, dtype)
    for _ in range(60):
        one.step()
        status |= one.status
        residual = np.maximum(residual, one.residual)
    many.step(60)
    assert_same_bits(one, many, ("q", "u", "time", "contact_impulse", "contact_active"))
    assert same_bits(many.status, status) and same_bits(many.residual, residual)
    before = many.q.copy()
    assert many.step(0) == ss.StepStatus.OK
    assert same_bits(many.q, before)


def test_long_calls_report_all_of_their_steps(ball: ss.Model) -> None:
    # So many robot-steps that the call is cut where it listens for Ctrl-C.
    world = ss.World()
    world.add_ground()
    world.add_robot(ball, position=(0, 0, 0.105))
    batch, one = ss.Batch(world, 8192), ss.Batch(world, 8192)
    for b in (batch, one):
        b.u[:, 0] = np.linspace(0, 1, 8192)
        b.generalized_force[7, 0] = np.nan
    status, residual = np.zeros(8192, np.uint32), np.zeros(8192, np.float32)
    for _ in range(50):
        one.step()
        status |= one.status
        residual = np.maximum(residual, one.residual)
    assert batch.step(50) == ss.StepStatus(int(np.bitwise_or.reduce(status)))
    assert batch.flagged(ss.StepStatus.NON_FINITE).tolist() == [7]
    assert same_bits(batch.status, status) and same_bits(batch.residual, residual)
    assert same_bits(batch.q, one.q)


# Snapshots and resets


@pytest.mark.parametrize("dtype", NUMBERS)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_replay_of_a_saved_state_is_equal_to_the_bit(dtype: str, integrator: str) -> None:
    batch = scattered(7, dtype, 2, integrator=integrator)
    run(batch, 150)
    blob = batch.save_state()
    before = {name: getattr(batch, name).copy() for name in ("q", "u", *OUTPUTS)}
    run(batch, 100, first=150)
    after = {name: getattr(batch, name).copy() for name in ("q", "u", *OUTPUTS)}
    assert after["contact_active"].any()
    other = scattered(7, dtype, 1, integrator=integrator)
    for b in (batch, other):
        b.load_state(blob)
        for name, value in before.items():
            assert same_bits(getattr(b, name), value), name
        assert b.save_state() == blob
        run(b, 100, first=150)
        for name, value in after.items():
            assert same_bits(getattr(b, name), value), name


@pytest.mark.parametrize("dtype", NUMBERS)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_reset_of_some_leaves_the_others_untouched(dtype: str, integrator: str) -> None:
    batch, undisturbed, fresh = (scattered(18, dtype, integrator=integrator) for _ in range(3))
    for b in (batch, undisturbed):
        run(b, 100)
    q, u = (x[[4, 17]] for x in scattered_states(18))
    batch.reset([17, 4], q[::-1], u[::-1])
    for name in OUTPUTS:
        assert not getattr(batch, name)[[4, 17]].any(), name
    others = np.isin(np.arange(18), [4, 17], invert=True)
    assert_same_bits(batch, undisturbed, ("q", "u", *OUTPUTS), others)
    for b in (batch, undisturbed, fresh):
        b.pd_target = STANCE
        b.step(100)
    assert_same_bits(batch, undisturbed, ("q", "u", *OUTPUTS), others)
    assert_same_bits(batch, fresh, ("q", "u", *OUTPUTS), ~others)
