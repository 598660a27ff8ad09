"""The same robot for MuJoCo: MJCF text with exactly the numbers of a Model, as benchmarks/compare/mjcf_writer.cc writes it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from stickslip._core import Body, Joint, Pose, Shape
from stickslip.bench.tasks import TIME_STEP, Task


def write_mjcf(task: Task) -> str:
    """Bodies and joints in the order of the Model (MuJoCo keeps it), one position actuator per joint.

    Only the ground can be touched; meshes are left out, as stickslip does. No joint limits, dry friction or armature;
    friction 0.8, elliptic cones, Newton; everything else is MuJoCo's default.
    """
    model = task.model
    ground = '<geom type="plane" size="0 0 1" contype="1" conaffinity="0"/>\n' if task.ground else ""
    actuators = "".join(
        f'<position joint="{joint_name(j)}" kp="{_numbers([kp])}" kv="{_numbers([kd])}"/>\n'
        for j, (kp, kd) in enumerate(zip(task.kp, task.kd, strict=True))
    )
    return (
        '<mujoco>\n<compiler angle="radian" autolimits="false" inertiafromgeom="false"/>\n'
        f'<option timestep="{_numbers([TIME_STEP])}" gravity="0 0 -9.81" cone="elliptic" solver="Newton"/>\n'
        '<default><geom friction="0.8 0 0" condim="3"/></default>\n'
        f"<worldbody>\n{ground}{_body(task, 0)}</worldbody>\n<actuator>\n{actuators if model.num_joints else ''}</actuator>\n</mujoco>\n"
    )


def joint_name(j: int) -> str:
    """What joint j of the Model is called there."""
    return f"j{j}"


def _body(task: Task, index: int) -> str:
    model = task.model
    opening = f'<body name="b{index}"'
    if index == 0:
        joint = "<freejoint/>\n" if model.base == "floating" else ""
        opening += ">\n" + joint
    else:
        opening += f" {_pose(model.joints[index - 1].pose)}>\n{_joint(model.joints[index - 1], index - 1)}"
    geoms = "".join(_geom(shape) for shape in model.shapes if shape.body == index)
    children = "".join(_body(task, j + 1) for j, joint in enumerate(model.joints) if joint.parent_body == index)
    return opening + _inertial(model.bodies[index]) + geoms + children + "</body>\n"


def _joint(joint: Joint, j: int) -> str:
    kind = "slide" if joint.type == "prismatic" else "hinge"
    return (
        f'<joint name="{joint_name(j)}" type="{kind}" axis="{_numbers(joint.axis)}" '
        f'damping="{_numbers([joint.damping])}"/>\n'
    )


def _inertial(body: Body) -> str:
    if not body.mass > 0:  # base of a fixed robot
        return ""
    m = body.inertia
    entries = [m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2]]
    return (
        f'<inertial pos="{_numbers(body.center_of_mass)}" mass="{_numbers([body.mass])}" '
        f'fullinertia="{_numbers(entries)}"/>\n'
    )


def _geom(shape: Shape) -> str:
    size = shape.size
    sizes = {
        "sphere": [size[0]],
        "box": size / 2,
        "cylinder": [size[0], size[1] / 2],
        "capsule": [size[0], size[1] / 2],
    }
    if shape.type not in sizes:
        return ""
    return (
        f'<geom type="{shape.type}" size="{_numbers(sizes[shape.type])}" {_pose(shape.pose)} '
        'contype="0" conaffinity="1"/>\n'
    )


def _pose(pose: Pose) -> str:
    return f'pos="{_numbers(pose.position)}" quat="{_numbers(_quaternion(pose.rotation))}"'


def _quaternion(r: np.ndarray) -> list[float]:
    """Unit quaternion w x y z of a rotation matrix; the largest component first, so that no division is by something small."""
    diagonal = np.diag(r)
    squares = np.array([1 + diagonal.sum(), *(1 + 2 * diagonal - diagonal.sum())])  # 4 times those of w x y z
    k = int(squares.argmax())
    w = np.array([squares[0], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    products = np.array(
        [
            w,
            [w[1], squares[1], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
            [w[2], r[0, 1] + r[1, 0], squares[2], r[1, 2] + r[2, 1]],
            [w[3], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], squares[3]],
        ]
    )
    return (products[k] / (2 * np.sqrt(squares[k]))).tolist()


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
