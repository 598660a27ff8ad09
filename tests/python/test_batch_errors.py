"""What a Batch says about bad input, and that it is then as it was."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import stickslip as ss
from batch_scenes import MODEL, OUTPUTS, PARAMETERS, anymal, arm

ARRAYS = ("q", "u", "generalized_force", "pd_target", *OUTPUTS, *PARAMETERS)


@pytest.fixture
def batch() -> ss.Batch:
    batch = ss.Batch(anymal(), 5, "float64")
    batch.step(3)
    return batch


def everything(batch: ss.Batch) -> list[bytes]:
    """All that a failing call must not change."""
    return [getattr(batch, name).tobytes() for name in ARRAYS] + [batch.save_state()]


# Worlds and options


def two_robots() -> ss.World:
    world = anymal()
    world.add_robot(MODEL, position=(3, 0, 1))
    return world


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: ss.World(), "robot"),
        (two_robots, "robot"),
        (lambda: anymal(method="per_contact"), "per_contact|kAuto|auto"),
        (lambda: anymal(method="pgs"), "pgs|kAuto|auto"),
    ],
)
def test_worlds_that_a_batch_cannot_hold_are_named(make, says: str) -> None:
    world = make()
    before = world.save_state()
    with pytest.raises(ss.ModelError, match=says):
        ss.Batch(world, 4)
    assert world.save_state() == before


@pytest.mark.parametrize(
    ("arguments", "error", "says"),
    [
        ({"num_envs": 0}, ValueError, "num_envs is 0; it must be at least 1"),
        ({"num_envs": -3}, ValueError, "num_envs is -3; it must be at least 1"),
        ({"num_envs": 2**31}, ValueError, "num_envs is 2147483648; it must be at most"),
        ({"num_envs": 4.0}, TypeError, "num_envs is 4.0; an integer"),
        ({"num_envs": True}, TypeError, "num_envs is True"),
        ({"regroup_every": -1}, ValueError, "regroup_every is -1; it must be zero or positive"),
        ({"regroup_every": 1.5}, TypeError, "regroup_every is 1.5; an integer"),
        ({"num_threads": -1}, ValueError, "num_threads is -1"),
        ({"num_threads": 1.5}, TypeError, "num_threads is 1.5"),
        ({"dtype": "float16"}, ValueError, "dtype is 'float16'; choose one of 'float32', 'float64'"),
        ({"dtype": "single precision"}, ValueError, "dtype is 'single precision'"),
        ({"dtype": np.int32}, ValueError, "choose one of 'float32', 'float64'"),
        ({"dtype": None}, ValueError, "dtype is None"),
        ({"instruction_set": "sse9"}, ss.ModelError, "sse9"),
        ({"instruction_set": 512}, TypeError, "instruction_set is 512"),
        ({"world": "anymal.urdf"}, TypeError, "world is a str; a stickslip.World is wanted"),
        ({"world": MODEL}, TypeError, "world is a Model"),
    ],
)
def test_bad_options_are_named(arguments: dict, error: type, says: str) -> None:
    with pytest.raises(error, match=says):
        ss.Batch(**{"world": anymal(), "num_envs": 4, **arguments})


# Arrays


@pytest.mark.parametrize("name", ["contact_impulse", "contact_active", "status", "residual", "time"])
def test_results_cannot_be_assigned(batch: ss.Batch, name: str) -> None:
    with pytest.raises(AttributeError, match=name):
        setattr(batch, name, 0)


@pytest.mark.parametrize("name", ["pd_target", "kp"])
@pytest.mark.parametrize(
    ("value", "error", "says"),
    [
        (np.zeros(11), ValueError, r"has shape \(11,\); it must be \(5, 12\), \(12,\) for all environments alike"),
        (np.zeros((4, 12)), ValueError, r"has shape \(4, 12\); it must be \(5, 12\)"),
        (np.zeros(5), ValueError, r"has shape \(5,\)"),
        (np.zeros((1, 5, 12)), ValueError, r"has shape \(1, 5, 12\)"),
        ([], ValueError, r"has shape \(0,\)"),
        ([[1, 2], [3]], ValueError, "a list that is not an array of numbers"),
        (np.zeros(12, complex), TypeError, "holds complex128; real numbers of a NumPy type are wanted"),
        (1j, TypeError, "holds complex128"),
        (True, TypeError, "holds bool"),
        (np.zeros((5, 12), bool), TypeError, "holds bool"),
        (None, TypeError, "holds object"),
        ([None] * 12, TypeError, "holds object"),
        ({"left": 1}, TypeError, "holds object"),
        ("left", TypeError, "holds str"),
        (["1"] * 12, TypeError, "holds str"),
        (np.zeros(12, "datetime64[s]"), TypeError, "holds datetime64"),
    ],
)
def test_arrays_of_another_shape_or_kind_are_refused(batch: ss.Batch, name: str, value, error: type, says: str) -> None:
    before = everything(batch)
    with pytest.raises(error, match=f"{name}:? .*{says}" if not says.startswith("has") else f"{name} {says}"):
        setattr(batch, name, value)
    assert everything(batch) == before


def row(batch: ss.Batch, name: str, index: tuple, value: float) -> np.ndarray:
    """The array with one number changed."""
    values = getattr(batch, name).copy()
    values[index] = value
    return values


@pytest.mark.parametrize(
    ("name", "index", "value", "says"),
    [
        ("kp", (3, 2), -1.0, r"kp: environment 3, joint 'LF_KFE' is -1\.0; it must be zero or positive"),
        ("kp", (3, 2), np.nan, "kp: environment 3, joint 'LF_KFE' is nan; it must be finite"),
        ("kd", (0, 0), np.inf, "kd: environment 0, joint 'LF_HAA' is inf; it must be finite"),
        ("friction", (4, 1), -0.2, "friction: environment 4, shape 'LF_FOOT/0' is -0.2"),
        ("friction", (4, 0), np.nan, "friction: environment 4, shape 'base/0' is nan"),
        ("gravity", (1, 2), np.nan, "gravity: environment 1, axis 'z' is nan"),
        (
            "body_mass",
            (2, 0),
            0.0,
            r"body_mass: environment 2, body 'base' is 0\.0; a body that moves needs a positive mass",
        ),
        ("body_mass", (2, 1), -1.0, "body_mass: environment 2, body 'LF_HIP' is -1.0"),
        ("body_mass", (2, 1), np.nan, "body_mass: environment 2, body 'LF_HIP' is nan"),
        ("body_com", (2, 1, 2), np.inf, r"body_com: environment 2, body 'LF_HIP' \[2\] is inf"),
        ("body_inertia", (1, 3, 0), np.nan, r"body_inertia: environment 1, body 'LF_SHANK' \[0\] is nan"),
        ("body_inertia", (1, 3, 0), 0.0, "body_inertia: environment 1, body 'LF_SHANK' is not positive definite"),
        ("body_inertia", (1, 3, 3), -1.0, "environment 1, body 'LF_SHANK' is not positive definite"),
        ("body_inertia", (1, 3, 1), 1.0, "environment 1, body 'LF_SHANK' is not positive definite"),
        ("body_inertia", (0, 0, 0), 9.0, "environment 0, body 'base' breaks the triangle inequality"),
        ("q", (3, 7), np.nan, "q: environment 3, coordinate 7 is nan"),
        ("q", (3, 3), 1.5, r"q: environment 3, base quaternion \(w, x, y, z\) at \[3:7\] has length 1\.5"),
    ],
)
def test_bad_numbers_are_named_by_environment_and_column(
    batch: ss.Batch, name: str, index: tuple, value: float, says: str
) -> None:
    before = everything(batch)
    bad = row(batch, name, index, value)
    with pytest.raises(ValueError, match=says):
        setattr(batch, name, bad)
    assert everything(batch) == before


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("kp", -1, "kp: every environment, every joint is -1; it must be zero or positive"),
        ("kp", np.arange(12.0) - 5, "kp: every environment, joint 'LF_HAA' is -5.0"),
        ("kp", [[1.0], [1.0], [np.nan], [1.0], [1.0]], "kp: environment 2, every joint is nan"),
        ("gravity", float("inf"), "gravity: every environment, every axis is inf"),
        ("body_mass", 0, "body_mass: every environment, body 'base' is 0"),
        ("body_inertia", [1, 0, 0, 1, 0, 3], "body_inertia: every environment, body 'base' breaks the triangle"),
        ("q", np.zeros(19), "q: every environment, base quaternion .* has length 0"),
    ],
)
def test_bad_numbers_for_all_are_named_once(batch: ss.Batch, name: str, value, says: str) -> None:
    before = everything(batch)
    with pytest.raises(ValueError, match=says):
        setattr(batch, name, value)
    assert everything(batch) == before


def test_values_for_columns_that_a_robot_does_not_have_are_no_error() -> None:
    builder = ss.ModelBuilder("stone")
    builder.add_link("stone", mass=1.0, inertia=0.1 * np.eye(3))
    world = ss.World()
    world.add_robot(builder.build())
    batch = ss.Batch(world, 2)
    batch.kp = -1.0
    batch.friction = -1.0
    assert batch.kp.shape == (2, 0) and batch.friction.shape == (2, 0)


def test_numbers_too_large_for_float32_are_refused_as_parameters_and_flagged_as_inputs() -> None:
    batch = ss.Batch(anymal(), 3)
    with pytest.raises(ValueError, match=r"gravity: environment 2, axis 'x' is 1e\+300; too large for float32"):
        batch.gravity = [[0, 0, -9], [0, 0, -9], [1e300, 0, -9]]
    with pytest.raises(ValueError, match="body_mass: every environment, body 'base' is 0.0"):
        batch.body_mass = 1e-300
    batch.generalized_force = [[0.0], [1e300], [0.0]]
    assert ss.StepStatus.NON_FINITE in batch.step()
    assert batch.flagged(ss.StepStatus.NON_FINITE).tolist() == [1]


def test_inputs_that_are_not_finite_may_be_assigned(batch: ss.Batch) -> None:
    for name in ("u", "pd_target", "generalized_force", "external_wrench"):
        value = getattr(batch, name).copy()
        value[1] = np.nan
        setattr(batch, name, value)
    assert batch.step() == ss.StepStatus.NON_FINITE
    assert batch.flagged(ss.StepStatus.NON_FINITE).tolist() == [1]


def test_base_of_a_fixed_robot_needs_no_mass() -> None:
    batch = ss.Batch(arm(), 3)
    assert batch.model.body_names == ["foundation", "upper", "lower"]
    batch.body_mass = [0.0, 1.0, 2.0]
    batch.body_inertia = [[0] * 6, [1, 0, 0, 1, 0, 1], [1, 0, 0, 1, 0, 1]]
    with pytest.raises(ValueError, match="body_mass: every environment, body 'upper' is 0.0; a body that moves"):
        batch.body_mass = [0.0, 0.0, 2.0]
    assert batch.step() == ss.StepStatus.OK


# Running


@pytest.mark.parametrize(
    ("steps", "error"), [(-1, ValueError), (2**31, ValueError), (1.5, TypeError), ("2", TypeError), (True, TypeError)]
)
def test_steps_are_counted_in_whole_numbers(batch: ss.Batch, steps, error: type) -> None:
    before = everything(batch)
    with pytest.raises(error, match="steps"):
        batch.step(steps)
    assert everything(batch) == before


Q, U = np.zeros(19), np.zeros(18)
Q[3] = 1


@pytest.mark.parametrize(
    ("arguments", "error", "says"),
    [
        (([0, 5],), IndexError, r"where\[1\] is 5; environments are 0 to 4"),
        (([-1],), IndexError, r"where\[0\] is -1; environments are 0 to 4"),
        ((7,), IndexError, r"where\[0\] is 7"),
        ((np.array([2**63], np.uint64),), IndexError, r"where\[0\] is 9223372036854775808"),
        (([1, 3, 2, 3],), ValueError, r"where\[3\] is 3, as is where\[1\]; name an environment once"),
        (([0.0, 1.0],), TypeError, "where holds float64; a boolean mask or integer indices"),
        ((1.0,), TypeError, "where holds float64"),
        ((["a"],), TypeError, "where holds str"),
        (([None],), TypeError, "where holds object"),
        ((np.zeros(4, bool),), ValueError, r"where is a mask of shape \(4,\); a mask must be \(5,\)"),
        ((np.zeros((5, 1), bool),), ValueError, r"where is a mask of shape \(5, 1\)"),
        ((True,), ValueError, r"where is a mask of shape \(\)"),
        ((np.zeros((2, 2), int),), ValueError, r"where has shape \(2, 2\)"),
        (([0, 1], Q[:-1]), ValueError, r"q has shape \(18,\); it must be \(2, 19\), one row per environment"),
        (([0, 1], np.tile(Q, (5, 1))), ValueError, r"q has shape \(5, 19\); it must be \(2, 19\)"),
        (([0, 1], 0.0), ValueError, r"q has shape \(\)"),
        (([0, 1], Q, np.zeros((2, 19))), ValueError, r"u has shape \(2, 19\); it must be \(2, 18\)"),
        (([0, 1], Q, np.zeros((1, 18))), ValueError, r"u has shape \(1, 18\)"),
        (([0, 1], Q * np.nan), ValueError, r"q\[0\] is nan; it must be finite"),
        (([0, 1], Q, [U, U + np.inf]), ValueError, r"u\[1, 0\] is inf; it must be finite"),
        (([0, 1], Q.astype(complex)), TypeError, "q holds complex128"),
        (([0, 1], Q.astype(bool)), TypeError, "q holds bool"),
        (([0, 1], [Q, Q * 0]), ValueError, "quaternion"),
        (([0, 1], [Q, Q * 1.01]), ValueError, "quaternion"),
        ((np.zeros(5, bool), Q[:3]), ValueError, r"q has shape \(3,\); it must be \(0, 19\)"),
    ],
)
def test_bad_resets_are_named_and_change_nothing(batch: ss.Batch, arguments: tuple, error: type, says: str) -> None:
    before = everything(batch)
    with pytest.raises(error, match=says):
        batch.reset(*arguments)
    assert everything(batch) == before


def test_states_too_large_for_float32_are_refused() -> None:
    batch = ss.Batch(anymal(), 2)
    with pytest.raises(ValueError, match=r"u\[3\] is 1e\+200; too large for float32"):
        batch.reset([1], Q, np.where(np.arange(18) == 3, 1e200, 0))


@pytest.mark.parametrize("blob", [b"", b"nonsense", b"\0" * 4096])
def test_foreign_blobs_are_refused_and_change_nothing(batch: ss.Batch, blob: bytes) -> None:
    before = everything(batch)
    for bad in (blob, before[-1][:-1], before[-1] + b"\0"):
        with pytest.raises(ValueError):
            batch.load_state(bad)
    with pytest.raises(TypeError, match="blob is a str"):
        batch.load_state("state")
    assert everything(batch) == before
    batch.load_state(bytearray(before[-1]))
    assert everything(batch) == before


def test_states_of_other_batches_are_refused(batch: ss.Batch) -> None:
    before = everything(batch)
    for other in (ss.Batch(anymal(), 4, "float64"), ss.Batch(anymal(), 5, "float32"), ss.Batch(arm(), 5, "float64")):
        with pytest.raises(ValueError):
            batch.load_state(other.save_state())
    with pytest.raises(ValueError):
        batch.load_state(anymal().save_state())
    assert everything(batch) == before


def test_status_to_look_for_is_made_of_bits(batch: ss.Batch) -> None:
    with pytest.raises(TypeError, match="status is 'NON_FINITE'"):
        batch.flagged("NON_FINITE")
    with pytest.raises(ValueError, match="status is -1"):
        batch.flagged(-1)


# Objects


@pytest.mark.parametrize("act", [copy.copy, copy.deepcopy, pickle.dumps])
def test_copies_are_refused_with_advice(batch: ss.Batch, act) -> None:
    with pytest.raises(TypeError, match="neither copied nor pickled; make another one .* save_state"):
        act(batch)


def test_mistyped_names_are_refused(batch: ss.Batch) -> None:
    with pytest.raises(AttributeError, match="a Batch has no 'pd_targets'; did you mean 'pd_target'"):
        batch.pd_targets = 0.0
    with pytest.raises(AttributeError, match="a Batch has no 'zzz'$"):
        batch.zzz = 0.0


def test_operators_in_place_say_that_their_result_stays(batch: ss.Batch) -> None:
    with pytest.raises(ValueError, match=r"kp: environment 0.* is -.*has put its result into the array already"):
        batch.kp -= 1000.0
    assert (batch.kp < 0).all()
    with pytest.raises(AttributeError, match="'time'.*has put its result into the array already"):
        batch.time += 1.0
    with pytest.raises(ValueError, match="must be zero or positive$"):
        batch.kp = -1.0


def test_masks_of_integers_are_recognized(batch: ss.Batch) -> None:
    with pytest.raises(ValueError, match="name an environment once; a mask must be bool"):
        batch.reset([1, 0, 0, 1, 0])
    with pytest.raises(ValueError, match="name an environment once$"):
        batch.reset([1, 1])


def test_parameters_are_own_once_they_are_used(batch: ss.Batch) -> None:
    assert not batch.has_own("kp")
    batch.kp = 3.0
    assert batch.has_own("kp") and not batch.has_own("kd")
    with pytest.raises(ValueError, match="name is 'pd_target'; choose one of 'kp', 'kd'"):
        batch.has_own("pd_target")


def test_flagged_means_any_bit_unless_told(batch: ss.Batch) -> None:
    batch.generalized_force[2] = np.nan
    batch.step()
    assert batch.flagged().tolist() == np.flatnonzero(batch.status).tolist()
    assert 2 in batch.flagged()
