"""What a world reports of its last step: status, contacts, solver effort, times."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class StepStatus(enum.IntFlag):
    """What a step reports; bits, or-ed over the robots."""

    OK = 0
    NOT_CONVERGED = 1
    """Cause: a contact solve stayed above its tolerance. Consequence: the best impulse found was used, see the residual in
    `solve_info`. Remedy: a smaller step."""
    NON_FINITE = 2
    """Cause: an input was not finite, or forces or velocities overflowed. Consequence: the robot was left in its last
    finite state; a World raises StepError, a Batch flags the environment. Remedy: a smaller step, smaller forces or gains."""


@dataclass(frozen=True)
class Contact:
    """One contact point of the last step (of its last substep, where there were several)."""

    robot: str  #: name of the robot
    body: str  #: name of its body
    shape: str  #: name of its shape: the URDF link and the shape's index there, as in "LF_FOOT/0"
    point: int  #: of the shape; a box has 8 corners
    position: Array  #: (3,) world [m], at the start of the step
    normal: Array  #: (3,) world, from the ground to the robot [1]
    gap: float  #: at the start of the step [m], negative where they overlap
    friction: float  #: Coulomb's coefficient [1]
    impulse: Array  #: (3,) on the robot, world axes [N s]
    velocity: Array  #: (3,) after the impulse, world axes [m/s]


@dataclass(frozen=True)
class SolveInfo:
    """What the last step did: of one robot, or the sums and worst values over a world."""

    status: StepStatus  #: bits
    contacts: int  #: candidates in the solve; a world: of all robots
    sweeps: int  #: passes over all contacts; a world: the most of any robot, as are all below
    newton_steps: int  #: of the solver's finish and fallback
    substeps: int  #: parts the step was cut into ("energy_safe")
    residual: float  #: largest contact residual [m/s]


@dataclass(frozen=True)
class StageTimes:
    """Seconds per stage since `World.reset_stage_times`, counted while `World.set_profiling(True)`."""

    dynamics: float  #: kinematics, bias force, mass matrix factor, free velocity [s]
    detection: float  #: candidates and gaps [s]
    delassus: float  #: rows of the contact problem [s]
    solve: float  #: contact impulses [s]
    integrate: float  #: final velocity, drift, position correction [s]
    steps: int  #: time steps counted
