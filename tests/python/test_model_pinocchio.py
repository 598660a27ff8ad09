"""Robot descriptions against Pinocchio: every URDF of example-robot-data loads alike, or is refused for a named reason.

Frames: ours are the links, one frame each; Pinocchio's frames of type BODY are the same. Its frames for joints and fixed
joints add no place that a link does not have.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from robots import example_robots

pin = pytest.importorskip("pinocchio")

FILES = example_robots()
if not FILES:
    pytest.skip("example-robot-data is not installed", allow_module_level=True)
ANYMAL = next(path for path in FILES if path.match("anymal_b_simple_description/robots/anymal.urdf"))

# What cannot be simulated, and what the error says of it. Everything else must load.
REFUSED = {
    "human.urdf": "link 'left_upperleg_virtual': the body that joint 'left_hip_Z' moves has no mass",
    "icub.urdf": "link 'r_hip_1': the inertia of the body that joint 'r_hip_pitch' moves",
    "icub_reduced.urdf": "link 'r_hip_1': the inertia of the body that joint 'r_hip_pitch' moves",
    "romeo.urdf": "link 'LFinger21Link': the body that joint 'LFinger21' moves has no mass",
    "romeo_laas_small.urdf": "not positive definite",
    "romeo_small.urdf": "link 'RShoulderYawLink': the inertia of the body that joint 'RShoulderYaw' moves",
    "ur3.urdf": "<robot> has no attribute 'name'",  # an empty <robot>, which Pinocchio refuses too
}

LOADED = [path for path in FILES if path.name not in REFUSED]


def _load_both(path: Path, base: str) -> tuple[ss.Model, pin.Model]:
    """Both models; Pinocchio's first body of ours is joint 1 (floating) or the universe (fixed)."""
    ours = ss.load_urdf(path, base=base)
    if base == "floating":
        return ours, pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
    return ours, pin.buildModelFromUrdf(str(path))


@pytest.mark.parametrize("base", ["floating", "fixed"])
@pytest.mark.parametrize("path", FILES, ids=[path.stem for path in FILES])
def test_robot_equals_pinocchios_or_is_refused_by_name(path: Path, base: str) -> None:
    if path.name in REFUSED:
        with pytest.raises(ss.ModelError) as refusal:
            ss.load_urdf(path, base=base)
        assert str(path) in str(refusal.value)
        assert REFUSED[path.name] in str(refusal.value)
        return

    ours, theirs = _load_both(path, base)
    first = 1 if base == "floating" else 0  # Pinocchio's index of our body 0
    assert ours.joint_names == list(theirs.names)[first + 1 :]
    assert ours.nu == theirs.nv
    assert ours.mass == pytest.approx(sum(i.mass for i in list(theirs.inertias)[1:]), rel=1e-12)

    links = {frame.name: frame for frame in theirs.frames if frame.type == pin.FrameType.BODY}
    assert set(ours.frame_names) == set(links)
    for frame in ours.frames:
        assert frame.body == links[frame.name].parentJoint - first
        np.testing.assert_allclose(frame.pose.position, links[frame.name].placement.translation, atol=1e-12)
        np.testing.assert_allclose(frame.pose.rotation, links[frame.name].placement.rotation, atol=1e-12)

    for j, joint in enumerate(ours.joints):
        assert joint.parent_body == theirs.parents[first + 1 + j] - first
        placement = theirs.jointPlacements[first + 1 + j]
        np.testing.assert_allclose(joint.pose.position, placement.translation, atol=1e-12)
        np.testing.assert_allclose(joint.pose.rotation, placement.rotation, atol=1e-12)

    for b, body in enumerate(ours.bodies):
        if b == 0 and base == "fixed":
            continue  # Pinocchio drops what does not move
        _check_inertia(body, theirs.inertias[first + b], 1e-11)


def _check_inertia(body: object, inertia: pin.Inertia, tolerance: float) -> None:
    size = np.abs(inertia.inertia).max()
    assert body.mass == pytest.approx(inertia.mass, rel=tolerance)
    np.testing.assert_allclose(body.center_of_mass, inertia.lever, rtol=0, atol=tolerance)
    np.testing.assert_allclose(body.inertia, inertia.inertia, rtol=0, atol=tolerance * size)


def test_most_robots_load() -> None:
    assert len(LOADED) >= 50
    assert {path.name for path in FILES} >= set(REFUSED)


@pytest.mark.parametrize("path", LOADED, ids=[path.stem for path in LOADED])
def test_limits_equal_pinocchios(path: Path) -> None:
    ours, theirs = _load_both(path, "fixed")
    for joint in ours.joints:
        there = theirs.joints[theirs.getJointId(joint.name)]
        v = there.idx_v
        assert joint.effort_limit == theirs.upperEffortLimit[v]
        assert joint.velocity_limit == theirs.upperVelocityLimit[v]
        assert joint.damping == theirs.damping[v]
        assert joint.friction == theirs.upperDryFrictionLimit[v]
        if joint.type != "continuous":
            assert joint.lower == theirs.lowerPositionLimit[there.idx_q]
            assert joint.upper == theirs.upperPositionLimit[there.idx_q]


def test_our_anymal_is_the_original() -> None:
    ours = ss.load_urdf(ss.assets.path("anymal_b"))
    original = ss.load_urdf(ANYMAL)
    assert ours.joint_names == original.joint_names
    assert ours.mass == pytest.approx(original.mass, rel=1e-8)
    for here, there in zip(ours.bodies, original.bodies, strict=True):
        assert here.name == there.name
        assert here.mass == pytest.approx(there.mass, rel=1e-8)
        np.testing.assert_allclose(here.center_of_mass, there.center_of_mass, rtol=1e-6)
        np.testing.assert_allclose(here.inertia, there.inertia, rtol=1e-6)
    for here, there in zip(ours.joints, original.joints, strict=True):
        np.testing.assert_array_equal(here.pose.position, there.pose.position)
        np.testing.assert_array_equal(here.pose.rotation, there.pose.rotation)
        np.testing.assert_array_equal(here.axis, there.axis)
        limits = ("lower", "upper", "velocity_limit", "effort_limit", "damping", "friction")
        assert [getattr(here, name) for name in limits] == [getattr(there, name) for name in limits]
    theirs = {shape.name: shape for shape in original.shapes}
    assert len(ours.shapes) == 5
    for shape in ours.shapes:
        np.testing.assert_array_equal(shape.size, theirs[shape.name].size)
        np.testing.assert_allclose(shape.pose.position, theirs[shape.name].pose.position, atol=1e-15)
        np.testing.assert_allclose(
            ours.frame(shape.name[:-2]).pose.position, original.frame(shape.name[:-2]).pose.position, atol=1e-15
        )


def test_our_anymals_legs_are_mirror_images() -> None:
    bodies = {body.name: body for body in ss.load_urdf(ss.assets.path("anymal_b")).bodies}
    for part in ("HIP", "THIGH", "SHANK"):
        front = bodies[f"LF_{part}"]
        for leg, sign in {"RF": (1, -1, 1), "LH": (-1, 1, 1), "RH": (-1, -1, 1)}.items():
            np.testing.assert_array_equal(bodies[f"{leg}_{part}"].center_of_mass, front.center_of_mass * sign)
            np.testing.assert_array_equal(bodies[f"{leg}_{part}"].inertia, front.inertia * np.outer(sign, sign))
