"""Dynamics against Pinocchio, an independent implementation, on the robots of example-robot-data.

Conventions. Our u has the base's linear and angular velocity in world axes, Pinocchio's v has both in base axes, so
u = B v with B = diag(R, R, 1). Then for equal power tau_ours = B tau, and for equal energy M_ours = B M B^T. The acceleration
of the base origin, d(R v_l)/dt = R (dv_l/dt + w x v_l), is not only turned, so with d = (w x v_l, 0, 0)

    du/dt = B (dv/dt + d),     h_ours = B (h - M d).

Joints are matched by name. Pinocchio stores a continuous joint as its cosine and sine.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from robots import example_robots

pin = pytest.importorskip("pinocchio")

TOLERANCE = 1e-11
SPEEDS = (1.0, 100.0)  # of base and joints [m/s, rad/s]; the second one makes velocity products dominate gravity


FILES = example_robots()
IDS = ["-".join(path.parts[-3:])[:-5] for path in FILES]


@dataclass
class Pair:
    """One robot in both libraries at the same random state."""

    ours: ss.Robot
    model: pin.Model
    data: pin.Data
    q: np.ndarray
    v: np.ndarray
    turn: np.ndarray  # B (nu, nv), which also orders the joints
    drift: np.ndarray  # d (nv,)


def _load(path: Path, base: str) -> ss.Model:
    try:
        return ss.load_urdf(path, base=base)
    except ss.ModelError as error:
        pytest.skip(f"not accepted: {error}")


def _pair(path: Path, base: str, speed: float, rng: np.random.Generator) -> Pair:
    ours = _load(path, base)
    world = ss.World()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        robot = world.add_robot(ours)
    model = pin.buildModelFromUrdf(str(path), *([pin.JointModelFreeFlyer()] if base == "floating" else []))
    assert model.nv == robot.nu

    first = 6 if base == "floating" else 0
    joints = rng.uniform(-1.5, 1.5, ours.num_joints)
    rates = speed * rng.uniform(-1, 1, robot.nu)
    q, v = pin.neutral(model), np.zeros(model.nv)
    turn, drift = np.zeros((robot.nu, model.nv)), np.zeros(model.nv)
    for j, name in enumerate(ours.joint_names):
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 2:
            q[joint.idx_q : joint.idx_q + 2] = np.cos(joints[j]), np.sin(joints[j])
        else:
            q[joint.idx_q] = joints[j]
        turn[first + j, joint.idx_v] = 1
    position = joints
    if base == "floating":
        quaternion = rng.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)  # w x y z
        place = rng.uniform(-2, 2, 3)
        q[:7] = *place, *quaternion[1:], quaternion[0]
        rotation = pin.Quaternion(quaternion[0], *quaternion[1:]).toRotationMatrix()
        turn[:3, :3] = turn[3:6, 3:6] = rotation
        position = np.concatenate([place, quaternion, joints])
    v = turn.T @ rates
    if base == "floating":
        drift[:3] = np.cross(v[3:6], v[:3])
    robot.set_state(position, rates)
    return Pair(robot, model, model.createData(), q, v, turn, drift)


def _pairs(path: Path, base: str):
    rng = np.random.default_rng([len(path.name), *path.name.encode()])
    for speed in SPEEDS:
        for _ in range(3):
            yield _pair(path, base, speed, rng)


def _solve_tolerance(path: Path) -> float:
    """Of what is divided by the mass matrix. Tiago's casters weigh nothing beside its body: its mass matrix has condition 5e6,
    of which any solver may lose so many times the rounding, 1e-9."""
    return 1e-9 if path.stem == "tiago_no_hand" else TOLERANCE


def _close(ours: np.ndarray, reference: np.ndarray, what: str, tolerance: float = TOLERANCE) -> None:
    """Largest difference against the largest element."""
    scale = np.abs(reference).max(initial=1e-12)
    error = np.abs(ours - reference).max(initial=0.0) / scale
    assert error <= tolerance, f"{what}: relative difference {error:.2e}, largest element {scale:.3g}"


def _mass_matrix(p: Pair) -> np.ndarray:
    """Pinocchio's, which fills the upper half only."""
    mass = pin.crba(p.model, p.data, p.q).copy()
    return np.triu(mass) + np.triu(mass, 1).T


@pytest.mark.parametrize("base", ["floating", "fixed"])
@pytest.mark.parametrize("path", FILES, ids=IDS)
def test_mass_matrix_bias_force_and_accelerations_equal_pinocchios(path: Path, base: str) -> None:
    rng = np.random.default_rng(1)
    for p in _pairs(path, base):
        mass = _mass_matrix(p)
        bias = pin.nonLinearEffects(p.model, p.data, p.q, p.v).copy()
        _close(p.ours.mass_matrix(), p.turn @ mass @ p.turn.T, "mass matrix")
        _close(p.ours.bias_force(), p.turn @ (bias - mass @ p.drift), "bias force")

        tau = p.turn @ rng.normal(size=p.model.nv) * np.abs(bias).max(initial=1.0)
        acceleration = p.turn @ (pin.aba(p.model, p.data, p.q, p.v, p.turn.T @ tau) + p.drift)
        _close(p.ours.forward_dynamics(tau), acceleration, "accelerations", _solve_tolerance(path))


@pytest.mark.parametrize("base", ["floating", "fixed"])
@pytest.mark.parametrize("path", FILES, ids=IDS)
def test_delassus_operator_equals_pinocchios(path: Path, base: str) -> None:
    rng = np.random.default_rng(2)
    for p in _pairs(path, base):
        bodies = rng.integers(0, len(p.ours.model.bodies), 4)
        pin.forwardKinematics(p.model, p.data, p.q)
        pin.computeJointJacobians(p.model, p.data, p.q)
        rows, points = [], []
        for body in bodies:
            joint = p.model.getJointId(p.ours.joint_names[body - 1]) if body else (1 if base == "floating" else 0)
            offset = p.data.oMi[joint].rotation @ rng.uniform(-0.3, 0.3, 3)
            points.append(p.data.oMi[joint].translation + offset)
            jacobian = np.zeros((6, p.model.nv))
            if joint:
                jacobian = pin.getJointJacobian(p.model, p.data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            rows.append(jacobian[:3] - pin.skew(offset) @ jacobian[3:])
        stacked = np.vstack(rows)
        mass = _mass_matrix(p)
        expected = stacked @ np.linalg.solve(mass, stacked.T) if p.model.nv else np.zeros((12, 12))
        _close(p.ours.delassus(bodies, points), expected, "Delassus operator", _solve_tolerance(path))


@pytest.mark.parametrize("base", ["floating", "fixed"])
@pytest.mark.parametrize("path", FILES, ids=IDS)
def test_frame_poses_and_jacobians_equal_pinocchios(path: Path, base: str) -> None:
    rng = np.random.default_rng(3)
    for p in _pairs(path, base):
        pin.computeJointJacobians(p.model, p.data, p.q)
        pin.updateFramePlacements(p.model, p.data)
        names = p.ours.frame_names
        for name in rng.choice(names, min(5, len(names)), replace=False):
            frame = p.model.getFrameId(str(name), pin.FrameType.BODY)
            pose = p.ours.frame_pose(str(name))
            _close(pose.position, p.data.oMf[frame].translation, f"position of {name}")
            _close(pose.rotation, p.data.oMf[frame].rotation, f"rotation of {name}")
            if p.model.nv == 0:  # where Pinocchio crashes
                assert p.ours.jacobian(str(name)).shape == (6, 0)
                continue
            jacobian = pin.getFrameJacobian(p.model, p.data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            _close(p.ours.jacobian(str(name)), jacobian @ p.turn.T, f"jacobian of {name}")


@pytest.mark.parametrize("base", ["floating", "fixed"])
def test_at_least_25_robots_are_compared(base: str) -> None:
    compared = set()
    for path in FILES:
        try:
            p = next(_pairs(path, base))
        except pytest.skip.Exception:  # a description that we refuse
            continue
        if p.model.nv == 0:
            continue
        _close(p.ours.mass_matrix(), p.turn @ _mass_matrix(p) @ p.turn.T, f"mass matrix of {path.stem}")
        compared.add(path.parts[-3])  # a folder per robot, with its variants
    assert len(compared) >= 25, sorted(compared)
