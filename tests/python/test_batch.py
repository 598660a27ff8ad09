"""Batch as Python sees it: its arrays and views, what it takes, resets and status."""

from __future__ import annotations

import gc

import numpy as np
import pytest

import stickslip as ss
from batch_scenes import MODEL, NUMBERS, OUTPUTS, STANCE, anymal, assert_same_bits, same_bits

# Arrays


@pytest.mark.parametrize("dtype", NUMBERS)
def test_arrays_have_their_documented_shapes(dtype: str) -> None:
    batch = ss.Batch(anymal(), 6, dtype)
    number = NUMBERS[dtype]
    wanted = {
        "q": ((6, 19), number),
        "u": ((6, 18), number),
        "generalized_force": ((6, 18), number),
        "pd_target": ((6, 12), number),
        "contact_impulse": ((6, 12, 3), number),
        "contact_active": ((6, 12), np.bool_),
        "status": ((6,), np.uint32),
        "residual": ((6,), number),
        "time": ((6,), np.float64),
        "kp": ((6, 12), number),
        "kd": ((6, 12), number),
        "friction": ((6, 5), number),
        "gravity": ((6, 3), number),
        "body_mass": ((6, 13), number),
        "body_com": ((6, 13, 3), number),
        "body_inertia": ((6, 13, 6), number),
        "external_wrench": ((6, 13, 6), number),
    }
    for name, (shape, kind) in wanted.items():
        array = getattr(batch, name)
        assert (array.shape, array.dtype) == (shape, kind), name
        assert array.flags.c_contiguous and array.flags.writeable and not array.flags.owndata, name
        assert getattr(batch, name) is array, name


@pytest.mark.parametrize("dtype", NUMBERS)
def test_arrays_begin_as_the_world_is(dtype: str) -> None:
    world = anymal(gravity=(0.5, 0, -9))
    robot = world.robots[0]
    robot.set_pd_gains(np.arange(12.0), np.arange(12.0, 24.0))
    robot.generalized_force = np.arange(18.0)
    world.set_material_pair("default", "default", friction=0.3)
    batch = ss.Batch(world, 3, dtype)
    inertias = [body.inertia[np.triu_indices(3)] for body in MODEL.bodies]
    wanted = {
        "q": robot.q,
        "u": robot.u,
        "generalized_force": np.arange(18.0),
        "pd_target": STANCE,
        "kp": np.arange(12.0),
        "kd": np.arange(12.0, 24.0),
        "friction": np.full(5, 0.3),
        "gravity": [0.5, 0, -9],
        "body_mass": [body.mass for body in MODEL.bodies],
        "body_com": [body.center_of_mass for body in MODEL.bodies],
        "body_inertia": inertias,
    }
    for name, row in wanted.items():
        np.testing.assert_array_equal(
            getattr(batch, name), np.tile(row, (3,) + (1,) * np.ndim(row)).astype(dtype), name
        )
    for name in (*OUTPUTS, "external_wrench"):
        assert not getattr(batch, name).any(), name


def test_columns_have_names() -> None:
    batch = ss.Batch(anymal(), 1)
    feet = ["LF_FOOT/0", "LH_FOOT/0", "RF_FOOT/0", "RH_FOOT/0"]
    assert batch.contact_shapes == ["base/0", *feet]
    assert batch.contact_points[:8] == [ss.ContactPoint("base", "base/0", k) for k in range(8)]
    assert [p.shape for p in batch.contact_points[8:]] == feet
    assert [p.body for p in batch.contact_points[8:]] == ["LF_SHANK", "LH_SHANK", "RF_SHANK", "RH_SHANK"]


def test_batch_says_what_it_is() -> None:
    world = anymal(time_step=2e-3)
    batch = ss.Batch(world, num_envs=40, num_threads=2)
    assert batch.model is world.robots[0].model
    assert (batch.num_envs, batch.dtype, batch.num_threads) == (40, np.float32, 2)
    assert batch.time_step == 2e-3
    assert batch.instruction_set in ("avx512", "avx2", "neon") and batch.width >= 1
    assert "40 'anymal_b' in float32" in repr(batch)
    assert ss.Batch(world, 1, np.float64).dtype == np.float64
    assert ss.Batch(world, 1, num_threads=0).num_threads >= 1
    assert ss.Batch(world, 1, instruction_set=batch.instruction_set, pin_threads=True).step() == ss.StepStatus.OK


def test_memory_grows_with_environments_and_with_used_parameters() -> None:
    small, large = ss.Batch(anymal(), 16), ss.Batch(anymal(), 1600)
    per_environment = (large.memory_bytes - small.memory_bytes) / 1584
    assert per_environment >= 4 * (19 + 18 + 18 + 12)
    before = large.memory_bytes
    assert large.body_inertia.nbytes <= large.memory_bytes - before


# Views


def test_what_is_written_into_a_view_is_seen_by_the_step() -> None:
    batch, plain = ss.Batch(anymal(), 5, "float64"), ss.Batch(anymal(), 5, "float64")
    batch.pd_target[3] += 0.3
    batch.q[1, 2] = 5.0
    batch.u[2, 0] = 1.0
    batch.generalized_force[4, 2] = 1000.0
    batch.step(20)
    plain.step(20)
    assert_same_bits(batch, plain, ("q", "u"), 0)
    assert batch.q[1, 2] == pytest.approx(5 - 0.5 * 9.81 * 0.02**2, abs=1e-4)
    assert batch.q[2, 0] == pytest.approx(0.02, abs=1e-3)
    assert batch.u[4, 2] > 0.1
    assert (np.abs(batch.q[3, 7:] - plain.q[3, 7:]) > 0.01).sum() >= 8


def test_view_outlives_its_batch() -> None:
    batch = ss.Batch(anymal(), 7)
    q, active = batch.q, batch.contact_active
    batch.step()
    expected = q.copy()
    del batch
    gc.collect()
    _ = [np.full((7, 19), 3.0, np.float32) for _ in range(50)]  # would reuse freed memory
    np.testing.assert_array_equal(q, expected)
    q[:] = 1.0
    assert q.sum() == 7 * 19 and active.shape == (7, 12)


def test_dlpack_shares_the_memory() -> None:
    batch = ss.Batch(anymal(), 4)
    shared = np.from_dlpack(batch.q)
    shared[2, 2] = 9.0
    assert batch.q[2, 2] == 9.0
    batch.step()
    assert shared[2, 2] != 9.0


def test_torch_shares_the_memory_and_is_taken() -> None:
    torch = pytest.importorskip("torch")
    batch = ss.Batch(anymal(), 4)
    shared = torch.from_dlpack(batch.u)
    shared[1, 0] = 2.0
    assert batch.u[1, 0] == 2.0
    batch.pd_target = torch.arange(12, dtype=torch.float64)
    np.testing.assert_array_equal(batch.pd_target, np.tile(np.arange(12), (4, 1)))
    batch.reset(torch.tensor([False, True, False, False]))
    assert batch.u[1, 0] == 0.0
    with pytest.raises(TypeError, match="pd_target: a Tensor.*grad"):
        batch.pd_target = torch.ones(12, requires_grad=True)


def test_jax_is_taken() -> None:
    jax = pytest.importorskip("jax")
    batch = ss.Batch(anymal(), 4)
    batch.pd_target = jax.numpy.arange(12.0)
    np.testing.assert_array_equal(batch.pd_target, np.tile(np.arange(12), (4, 1)))
    batch.reset(jax.numpy.array([0, 2]))


# What may be assigned


class OnlyDlpack:
    def __init__(self, array: np.ndarray):
        self._array = array

    def __dlpack__(self, **options):
        return self._array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self._array.__dlpack_device__()


class OnOtherDevice(OnlyDlpack):
    def __dlpack_device__(self):
        return (2, 0)

    def __array__(self, dtype=None, copy=None):
        return self._array


TARGETS = np.arange(60.0).reshape(5, 12)


@pytest.mark.parametrize(
    ("value", "result"),
    [
        (TARGETS, TARGETS),
        (TARGETS.tolist(), TARGETS),
        (TARGETS.astype(np.float16), TARGETS),
        (TARGETS.astype(np.uint8), TARGETS),
        (TARGETS.astype(">f4"), TARGETS),
        (np.asfortranarray(TARGETS), TARGETS),
        (np.repeat(TARGETS, 2, axis=1)[:, ::2], TARGETS),
        (OnlyDlpack(TARGETS), TARGETS),
        (OnOtherDevice(TARGETS), TARGETS),
        (TARGETS[2], np.tile(TARGETS[2], (5, 1))),
        (TARGETS[:, :1], np.tile(TARGETS[:, :1], (1, 12))),
        (2, np.full((5, 12), 2)),
        (np.float32(0.5), np.full((5, 12), 0.5)),
        (np.array(3), np.full((5, 12), 3)),
    ],
)
def test_assigned_arrays_are_copied_with_broadcasting(value, result) -> None:
    batch = ss.Batch(anymal(), 5)
    target = batch.pd_target
    batch.pd_target = value
    assert batch.pd_target is target
    np.testing.assert_array_equal(target, result.astype(np.float32))
    batch.kp = value
    np.testing.assert_array_equal(batch.kp, result.astype(np.float32))


def test_arithmetic_in_place_works_on_properties() -> None:
    batch = ss.Batch(anymal(), 5, "float64")
    batch.u += 1
    batch.kp *= 2
    assert (batch.u == 1).all() and (batch.kp == 160).all()
    batch.q = batch.q[::-1]
    batch.body_inertia = batch.body_inertia[0]


# Resets


@pytest.mark.parametrize(
    ("where", "envs"),
    [
        (None, [0, 1, 2, 3, 4]),
        ([3], [3]),
        (3, [3]),
        (np.int8(3), [3]),
        ((4, 0), [0, 4]),
        (range(1, 4), [1, 2, 3]),
        (np.array([2, 1], np.uint64), [1, 2]),
        (np.array([0, 9, 2, 9])[::2], [0, 2]),
        (np.array([2], np.int32), [2]),
        ([False, True, False, False, True], [1, 4]),
        (np.array([False, True, False, False, True]), [1, 4]),
        (OnlyDlpack(np.array([1, 4])), [1, 4]),
        (np.zeros(5, bool), []),
        ([], []),
        (np.array([], np.int64), []),
    ],
)
def test_where_is_a_mask_or_indices(where, envs: list[int]) -> None:
    batch = ss.Batch(anymal(), 5)
    batch.step(5)
    batch.reset(where)
    assert np.flatnonzero(batch.time == 0).tolist() == envs


def test_states_of_a_reset_may_be_one_for_all_and_of_any_kind() -> None:
    batch = ss.Batch(anymal(), 4, "float64")
    q = batch.q[0].copy()
    q[:2] = 3, 4
    batch.reset([0, 2], q=q)
    assert batch.q[:, 0].tolist() == [3, 0, 3, 0]
    batch.reset(np.array([True, False, True, False]), q.astype(np.float32)[None].repeat(2, 0), np.ones(18, int))
    assert batch.u[:, 0].tolist() == [1, 0, 1, 0]
    rows = np.asfortranarray(np.tile(q, (4, 1)))
    rows[:, 0] = range(4)
    batch.reset(None, OnlyDlpack(rows), u=[2.0] * 18)
    assert batch.q[:, 0].tolist() == [0, 1, 2, 3] and (batch.u == 2).all()
    q[3:7] = 0.5, 0.5, 0.5, 0.5004
    batch.reset([1], q)
    assert np.linalg.norm(batch.q[1, 3:7]) == pytest.approx(1, abs=1e-15)
    batch.reset()
    assert same_bits(batch.q, np.tile(anymal().robots[0].q, (4, 1))) and not batch.u.any()


def test_batch_takes_the_present_state_of_its_world() -> None:
    world = anymal()
    world.step(150)
    robot = world.robots[0]
    batch = ss.Batch(world, 3, "float64")
    robot.set_state(robot.q, robot.u)  # forgets its warm start, as a new batch has none
    assert same_bits(batch.q, np.tile(robot.q, (3, 1))) and not batch.time.any()
    world.step(100)
    batch.step(100)
    assert same_bits(batch.q, np.tile(robot.q, (3, 1))) and same_bits(batch.u, np.tile(robot.u, (3, 1)))
    batch.reset([1])
    assert batch.q[1, 2] != batch.q[0, 2]


# Status and profile


def test_flagged_looks_for_any_of_the_bits() -> None:
    batch = ss.Batch(anymal(), 6)
    batch.status[:] = [0, 1, 2, 3, 0, 4]
    assert batch.flagged(ss.StepStatus.NOT_CONVERGED).tolist() == [1, 3]
    found = batch.flagged(ss.StepStatus.NON_FINITE | ss.StepStatus.NOT_CONVERGED)
    assert found.tolist() == [1, 2, 3] and found.dtype == np.int64
    assert batch.flagged(ss.StepStatus.OK).tolist() == []


def test_profiling_counts_robot_steps_only_while_it_is_on() -> None:
    batch = ss.Batch(anymal(), 20, num_threads=2)
    batch.step(5)
    assert batch.stage_times.steps == 0
    batch.set_profiling(True)
    batch.step(5)
    times = batch.stage_times
    assert times.steps == 100 and times.dynamics > 0 and times.integrate > 0
    batch.set_profiling(False)
    batch.step()
    assert batch.stage_times.steps == 100
    batch.reset_stage_times()
    assert batch.stage_times.steps == 0
