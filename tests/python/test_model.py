"""Model, ModelBuilder and the URDF reader as Python sees them; tests/cpp/model has every kind of bad input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stickslip as ss

UNIT = {"mass": 1.0, "inertia": np.eye(3)}


def _pendulum() -> ss.ModelBuilder:
    builder = ss.ModelBuilder("pendulum", source="here")
    builder.add_link("pivot")
    builder.add_link("rod", center_of_mass=(0, 0, -0.5), **UNIT)
    builder.add_joint(
        "hinge", "revolute", "pivot", "rod", position=(0, 0, 2), axis=(0, 2, 0), lower=-1, upper=1, damping=0.1
    )
    return builder


def test_builder_builds_what_it_is_told() -> None:
    builder = _pendulum()
    builder.add_shape("rod", "capsule", (0.1, 1.0), position=(0, 0, -0.5), orientation=(1, 1, 0, 0), material="rubber")
    model = builder.build(base="fixed")
    assert (model.name, model.base, model.nq, model.nu, model.num_joints) == ("pendulum", "fixed", 1, 1, 1)
    assert model.joint_names == ["hinge"] and model.body_names == ["pivot", "rod"]
    joint = model.joints[0]
    np.testing.assert_array_equal(joint.axis, [0, 1, 0])
    np.testing.assert_array_equal(joint.pose.position, [0, 0, 2])
    assert (joint.type, joint.lower, joint.upper, joint.damping) == ("revolute", -1, 1, 0.1)
    assert joint.effort_limit == np.inf
    shape = model.shapes[0]
    assert (shape.name, shape.type, shape.body, shape.material) == ("rod/0", "capsule", 1, "rubber")
    np.testing.assert_allclose(shape.pose.rotation, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-15)
    np.testing.assert_array_equal(shape.size, [0.1, 1.0, 0.0])
    assert model.mass == 1.0
    np.testing.assert_array_equal(model.lower, [-1.0])


def test_floating_base_adds_seven_and_six(flail: ss.Model) -> None:
    assert (flail.nq, flail.nu) == (8, 7)
    assert flail.frame("tip").body == 1
    assert "floating" in flail.base and "flail" in repr(flail)


def test_parts_outlive_the_model() -> None:
    joint, frame = _pendulum().build("fixed").joints[0], _pendulum().build("fixed").frame("rod")
    assert joint.name == "hinge" and frame.name == "rod"


def test_arrays_are_copies(flail: ss.Model) -> None:
    flail.bodies[0].inertia[:] = 0
    assert flail.bodies[0].inertia[0, 0] == 0.01


def test_errors_name_the_place(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"nowhere\.urdf: there is no such file"):
        ss.load_urdf(tmp_path / "nowhere.urdf")
    bad = tmp_path / "bad.urdf"
    bad.write_text("<robot name='r'>\n  <link name='a'/>\n</robot>")
    with pytest.raises(ss.ModelError, match=r"bad\.urdf:2: link 'a': the floating base has no mass"):
        ss.load_urdf(bad)
    assert issubclass(ss.ModelError, ValueError)
    with pytest.raises(ValueError, match="base is 'flying'; use 'floating' or 'fixed'"):
        ss.load_urdf(bad, base="flying")
    with pytest.raises(ValueError, match="here: link 'pivot': the floating base has no mass"):
        _pendulum().build()


def test_builder_refuses_bad_arguments() -> None:
    builder = _pendulum()
    with pytest.raises(ValueError, match="link 'a': inertia\\[1\\]\\[0\\] differs"):
        builder.add_link("a", mass=1, inertia=[[1, 0.5, 0], [0, 1, 0], [0, 0, 1]])
    with pytest.raises(ValueError, match="give both mass and inertia"):
        builder.add_link("a", mass=1)
    with pytest.raises(ValueError, match="joint type 'screw' is unknown"):
        builder.add_joint("j", "screw", "pivot", "rod")
    with pytest.raises(ValueError, match="size of a box has 3 numbers, not 1"):
        builder.add_shape("rod", "box", (1,))
    with pytest.raises(ValueError, match="shape type 'cone' is unknown"):
        builder.add_shape("rod", "cone", (1,))
    with pytest.raises(ValueError, match="orientation is not a quaternion"):
        builder.add_shape("rod", "sphere", (1,), orientation=(0, 0, 0, 0))
    builder.build("fixed")  # none of them has left a trace
