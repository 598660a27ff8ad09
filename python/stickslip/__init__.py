"""stickslip: robots with hard contacts and exact Coulomb friction.

SI units everywhere. A robot's `q` is base position (3), base quaternion w x y z (4), joints; its `u` is base linear and
angular velocity (3 + 3, world axes, of the base origin), then joint rates. A fixed base has the joints only.
"""

from importlib.metadata import version as _version

from stickslip import _cpu

_cpu.check()

from stickslip import assets, problems  # noqa: E402
from stickslip._core import Model, ModelBuilder, ModelError, Pose, load_urdf, parse_urdf  # noqa: E402
from stickslip.batch import Batch, ContactPoint  # noqa: E402
from stickslip.contact import (  # noqa: E402
    Certificate,
    ContactProblem,
    ContactSolution,
    certify,
    residual,
    solve,
    solve_contact,
)
from stickslip.world import Contact, Robot, SolveInfo, StepError, StepStatus, World  # noqa: E402

__version__ = _version("stickslip")

__all__ = [
    "Batch",
    "Certificate",
    "Contact",
    "ContactPoint",
    "ContactProblem",
    "ContactSolution",
    "Model",
    "ModelBuilder",
    "ModelError",
    "Pose",
    "Robot",
    "SolveInfo",
    "StepError",
    "StepStatus",
    "World",
    "assets",
    "certify",
    "load_urdf",
    "parse_urdf",
    "problems",
    "residual",
    "solve",
    "solve_contact",
]
