"""Batch as Python sees it: its arrays, and that every environment is a World of its own."""

from __future__ import annotations

import gc
import os
import signal
import threading
import time

import numpy as np
import pytest

import stickslip as ss
from batch_of_worlds import BatchOfWorlds
from batch_scenes import (
    MODEL,
    OUTPUTS,
    STANCE,
    anymal,
    arm,
    assert_same_bits,
    box,
    drive,
    payload,
    same_bits,
    scattered_states,
)

NUMBERS = {"float32": np.float32, "float64": np.float64}
PARAMETERS = ("kp", "kd", "friction", "gravity", "body_mass", "body_com", "body_inertia", "external_wrench")
INTEGRATORS = ("energy_safe", "semi_implicit")


def scattered(num_envs: int, dtype: str = "float64", num_threads: int = 1, **options) -> ss.Batch:
    batch = ss.Batch(anymal(**options), num_envs, dtype, num_threads)
    batch.reset(None, *scattered_states(num_envs))
    return batch


def run(batch: ss.Batch, steps: int, first: int = 0) -> None:
    for step in range(first, first + steps, 5):
        drive(batch, step)
        batch.step(5)


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


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="counts threads as Linux lists them")
def test_dropped_batches_take_their_threads_along() -> None:
    def drop() -> None:
        ss.Batch(anymal(), 64, num_threads=3).step()
        gc.collect()

    drop()
    before = len(os.listdir("/proc/self/task"))
    for _ in range(3):
        drop()
    assert len(os.listdir("/proc/self/task")) == before
    assert not [thing for thing in gc.get_objects() if type(thing) is ss.Batch]


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


def test_gains_and_friction_have_the_bits_of_worlds() -> None:
    batch, worlds = ss.Batch(anymal(), 4, "float64"), BatchOfWorlds(anymal, 4)
    for b in (batch, worlds):
        b.reset(None, *scattered_states(4))
        b.kp = [[40.0], [60.0], [80.0], [0.0]]
        b.kd = [[0.5], [1.0], [2.0], [0.0]]
        b.friction = [[0.0], [0.2], [0.8], [1.5]]
    for _ in range(30):
        batch.step(10)
        worlds.step(10)
        assert_same_bits(batch, worlds, ("q", "u", *OUTPUTS))


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


def test_float32_stays_near_float64() -> None:
    batches = [ss.Batch(anymal(), 4, dtype) for dtype in NUMBERS]
    for batch in batches:
        batch.reset(None, *scattered_states(4))
        run(batch, 100)
    np.testing.assert_allclose(batches[0].q[::2], batches[1].q[::2], rtol=0, atol=1e-3)
    assert batches[0].residual.max() < 1e-4


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


# Bits do not depend on the neighbors


@pytest.mark.parametrize("dtype", NUMBERS)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_number_of_environments_and_threads_change_no_bit(dtype: str, integrator: str) -> None:
    everything = scattered(33, dtype, integrator=integrator)
    run(everything, 200)
    assert everything.contact_active.any()
    for num_envs in (1, 5, 16, 17, 33):
        for num_threads in (1, 2, 3):
            batch = scattered(num_envs, dtype, num_threads, integrator=integrator)
            run(batch, 200)
            assert_same_bits(
                batch, everything, ("q", "u", *OUTPUTS), slice(num_envs), f"{num_envs}, {num_threads} threads"
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
def test_several_steps_at_once_are_steps_one_by_one(dtype: str) -> None:
    one, many = scattered(9, dtype), scattered(9, dtype)
    status, residual = np.zeros(9, np.uint32), np.zeros(9, dtype)
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


def test_interrupt_ends_a_long_call(ball: ss.Model) -> None:
    world = ss.World()
    world.add_robot(ball)
    batch = ss.Batch(world, 1, num_threads=1)
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with pytest.raises(KeyboardInterrupt):
            batch.step(2**31 - 1)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
    assert 0 < batch.time[0] < 1e5
    assert batch.step() == ss.StepStatus.OK


def test_other_python_threads_run_during_a_step() -> None:
    batch = scattered(256, "float64", 1)
    ticks, done = [], threading.Event()

    def tick() -> None:
        while not done.wait(1e-3):
            ticks.append(time.perf_counter())

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.perf_counter()
    batch.step(1000)
    end = time.perf_counter()
    done.set()
    thread.join()
    during = [t for t in ticks if start < t < end - 1e-3]
    assert len(during) > 3, f"{len(during)} ticks in {end - start:.3f} s"


# Environments that are not finite


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


def test_flagged_looks_for_any_of_the_bits() -> None:
    batch = ss.Batch(anymal(), 6)
    batch.status[:] = [0, 1, 2, 3, 0, 4]
    assert batch.flagged(ss.StepStatus.NOT_CONVERGED).tolist() == [1, 3]
    found = batch.flagged(ss.StepStatus.NON_FINITE | ss.StepStatus.NOT_CONVERGED)
    assert found.tolist() == [1, 2, 3] and found.dtype == np.int64
    assert batch.flagged(ss.StepStatus.OK).tolist() == []


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


# Parameters


@pytest.mark.parametrize("dtype", NUMBERS)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_reading_parameters_changes_no_bit(dtype: str, integrator: str) -> None:
    batch, plain = (scattered(9, dtype, integrator=integrator) for _ in range(2))
    batch.step(40)
    plain.step(40)
    for name in PARAMETERS:
        setattr(batch, name, getattr(batch, name).copy())
        assert getattr(batch, name).shape[0] == 9
    batch.step(100)
    plain.step(100)
    assert_same_bits(batch, plain, ("q", "u", *OUTPUTS))


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_mass_is_that_of_a_model_with_such_a_mass(integrator: str) -> None:
    extra = [-3.0, 0.0, 5.0]
    batch = ss.Batch(anymal(integrator=integrator), 3, "float64")
    batch.body_mass[:, 0] += extra
    batch.step(300)
    for env, mass in enumerate(extra):
        world = anymal(payload(mass), integrator=integrator)
        world.step(300)
        assert same_bits(batch.q[env], world.robots[0].q), mass
        assert same_bits(batch.u[env], world.robots[0].u), mass
    # The heavier, the deeper it stands against its springs.
    assert batch.q[0, 2] > batch.q[1, 2] + 1e-4 > batch.q[2, 2] + 2e-4


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_inertia_and_center_of_mass_are_those_of_a_model_that_has_them(integrator: str) -> None:
    inertia, center = np.diag([0.02, 0.03, 0.04]), (0.01, -0.02, 0.03)

    def single(**properties) -> ss.World:
        builder = ss.ModelBuilder("body")
        builder.add_link("body", mass=2.0, **properties)
        builder.add_shape("body", "box", (0.3, 0.2, 0.1))
        world = ss.World(integrator=integrator)
        world.add_ground()
        robot = world.add_robot(builder.build(), position=(0, 0, 0.15))
        robot.set_state(robot.q, [0.5, 0, 0, 1, 2, 3])
        return world

    batch = ss.Batch(single(inertia=0.01 * np.eye(3)), 3, "float64")
    batch.body_inertia[1] = inertia[np.triu_indices(3)]
    batch.body_com[2] = center
    worlds = [
        single(inertia=0.01 * np.eye(3)),
        single(inertia=inertia),
        single(inertia=0.01 * np.eye(3), center_of_mass=center),
    ]
    for _ in range(30):
        batch.step(10)
        for env, world in enumerate(worlds):
            world.step(10)
            assert same_bits(batch.q[env], world.robots[0].q), env
    assert batch.contact_active.all(axis=0).any() and np.ptp(batch.q, axis=0).max() > 0.01


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_gravity_is_that_of_a_world_that_has_it(integrator: str) -> None:
    gravities = [(0, 0, -9.81), (0, 0, -1.62), (1.5, -0.5, -9), (0, 0, 0)]
    batch = ss.Batch(anymal(integrator=integrator), 4, "float64")
    batch.gravity = gravities
    batch.step(300)
    for env, gravity in enumerate(gravities):
        world = anymal(integrator=integrator, gravity=gravity)
        world.step(300)
        assert same_bits(batch.q[env], world.robots[0].q), gravity


@pytest.mark.parametrize("dtype", NUMBERS)
def test_box_slides_where_gravity_leans_more_than_friction_holds(dtype: str) -> None:
    # On a slope of angle a: at rest up to tan a = mu, else acceleration g (sin a - mu cos a).
    slope = np.array([0.1, 0.2, 0.3, 0.3, 0.3, 0.4])
    mu = np.array([0.5, 0.5, 0.5, 0.2, 0.0, 0.35])
    batch = ss.Batch(box(), 6, dtype)
    batch.gravity = 9.81 * np.stack([np.sin(slope), np.zeros(6), -np.cos(slope)], axis=1)
    batch.friction = mu[:, None]
    batch.step(200)
    # In contact, u lacks half a step of gravity (`Robot.mechanical_energy`): 199.5 steps of 1 ms.
    expected = 9.81 * np.maximum(0, np.sin(slope) - mu * np.cos(slope)) * 0.1995
    np.testing.assert_allclose(batch.u[:, 0], expected, rtol=1e-4, atol=1e-6)
    assert (expected[:3] == 0).all() and (expected[3:] > 0.1).all()


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_wrench_on_the_base_is_a_generalized_force(integrator: str) -> None:
    # About the base origin: force f, torque t + c x f with c the center of mass, turned with the body. One step, so that c stays.
    rng = np.random.default_rng(3)
    wrench = rng.uniform(-50, 50, (8, 6))
    wrenches, forces = (scattered(8, integrator=integrator) for _ in range(2))
    wrenches.external_wrench[:, 0] = wrench
    for env in range(8):
        robot = anymal().robots[0]
        robot.set_state(*(x[env] for x in scattered_states(8)))
        arm = robot.frame_pose("base").rotation @ MODEL.bodies[0].center_of_mass
        f, t = wrench[env, :3], wrench[env, 3:]
        forces.generalized_force[env, :6] = [*f, *(t + np.cross(arm, f))]
    wrenches.step()
    forces.step()
    np.testing.assert_allclose(wrenches.u, forces.u, rtol=0, atol=1e-9)
    forces.reset(None, *scattered_states(8))
    forces.generalized_force = 0
    forces.step()
    assert (np.abs(wrenches.u - forces.u).max(axis=1) > 1e-4).all()


def test_wrench_on_a_link_acts_through_its_jacobian() -> None:
    body = MODEL.body_index("RH_THIGH")
    wrench = np.array([30.0, -20.0, 10.0, 4.0, -5.0, 6.0])
    wrenches, forces = scattered(6), scattered(6)
    wrenches.external_wrench[:, body] = wrench
    for env in range(6):
        robot = anymal().robots[0]
        robot.set_state(*(x[env] for x in scattered_states(6)))
        arm = robot.frame_pose("RH_THIGH").rotation @ MODEL.bodies[body].center_of_mass
        moment = np.concatenate([wrench[:3], wrench[3:] + np.cross(arm, wrench[:3])])
        forces.generalized_force[env] = robot.jacobian("RH_THIGH").T @ moment
    wrenches.step()
    forces.step()
    np.testing.assert_allclose(wrenches.u, forces.u, rtol=0, atol=1e-9)


def test_parameters_stay_through_resets_and_snapshots() -> None:
    batch = ss.Batch(anymal(), 3)
    blob = batch.save_state()
    batch.friction = 0.1
    batch.pd_target = 0.5
    batch.reset()
    batch.load_state(blob)
    assert (batch.friction == np.float32(0.1)).all() and (batch.pd_target == 0.5).all()


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


def test_forked_process_steps_on_with_the_same_bits() -> None:
    batch = ss.Batch(anymal(), 40, "float64", num_threads=2)
    batch.reset(None, *scattered_states(40))
    batch.step(5)
    start = batch.save_state()
    batch.step(5)
    expected = batch.q.tobytes()
    batch.load_state(start)
    read, write = os.pipe()
    child = os.fork()
    if child == 0:  # nothing of pytest may run here
        batch.step(5)
        os.write(write, b"1" if batch.q.tobytes() == expected else b"0")
        os._exit(0)
    os.waitpid(child, 0)
    assert os.read(read, 1) == b"1"
    os.close(read)
    os.close(write)


def test_two_threads_on_one_batch_are_told() -> None:
    batch = ss.Batch(anymal(), 64, num_threads=2)
    errors: list[str] = []

    def work() -> None:
        for _ in range(20):
            try:
                batch.step(20)
            except ValueError as error:
                errors.append(str(error))

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert not any(thread.is_alive() for thread in threads)
    assert errors and all("another thread is at work on this batch" in error for error in errors)


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
        outcomes.append((int(batch.status[0]), batch.q[0].tobytes(), batch.u[0].tobytes()))
    assert outcomes[0][0] == int(ss.StepStatus.NON_FINITE)
    assert all(outcome == outcomes[0] for outcome in outcomes)


def test_state_that_is_none_is_set_aside_for_the_whole_call() -> None:
    # Long calls are cut into parts, more of them for more environments.
    outcomes = []
    for num_envs in (1, 1024):
        batch = ss.Batch(anymal(), num_envs)
        batch.q[0, 2] = np.nan
        assert ss.StepStatus.NON_FINITE in batch.step(600)
        outcomes.append((int(batch.status[0]), float(batch.time[0]), batch.q[0].tobytes()))
    assert outcomes[0] == outcomes[1]
    assert outcomes[0][0] == int(ss.StepStatus.NON_FINITE)


def test_wrench_on_a_fixed_base_moves_nothing() -> None:
    plain, pulled = (ss.Batch(arm(integrator="energy_safe"), 3, "float64") for _ in range(2))
    for batch in (plain, pulled):
        batch.kp[:], batch.kd[:] = 0.0, 0.0
    pulled.external_wrench[:, 0] = 100.0
    plain.step(100)
    pulled.step(100)
    assert_same_bits(plain, pulled, ("q", "u", *OUTPUTS))
