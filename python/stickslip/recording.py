"""Contact problems that a world meets, written to FCLIB files while it steps."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip import fclib
from stickslip._arguments import count
from stickslip.fclib.hdf5 import path_of
from stickslip.reports import StepStatus

if TYPE_CHECKING:
    from stickslip.world import Robot, World

_VERSION = version("stickslip")
_FIELDS = ("step", "index", "robot", "time")
_DEFAULT = "step{step:08d}_robot{index}_{robot}.hdf5"


class Recorder:
    """Steps a world and writes the problems of every `every`-th step that has contacts, one file per robot.

    path: a folder (made if missing), or a pattern of file names like "drop/{step:06d}_{robot}.hdf5" with the fields step, index,
        robot and time.
    """

    def __init__(self, world: World, path: str | os.PathLike[str], every: int = 1):
        self._world = world
        self._every = count("every", every)
        if self._every == 0:
            raise ValueError("every is 0; it must be at least 1")
        self._pattern = _pattern(path_of(path))
        self._seen = 0  # steps with contacts

    def step(self, steps: int) -> tuple[int, int]:
        """Steps the world as its core does: returns the status bits, or-ed, and the number of steps; an overflow ends them."""
        bits = done = 0
        while done < steps and StepStatus.NON_FINITE not in StepStatus(bits):
            bits |= self._step()
            done += 1
        return bits, done

    def _step(self) -> int:
        core, robots = self._world._core, self._world._robots
        start = self._world.time
        problems = []
        if self._seen % self._every == 0:
            # Asking for the next problem costs a second step, little beside writing a file, and changes no bit of the next one.
            problems = [core.next_contact_problem(k) for k in range(len(robots))]
        bits, _ = core.step(1)
        if any(robot.solve_info.contacts for robot in robots):
            self._seen += 1
        if StepStatus.NON_FINITE not in StepStatus(bits):
            self._write(start, problems)
        return bits

    def _write(self, start: float, problems: Sequence[tuple]) -> None:
        world = self._world
        written: dict[str, str] = {}
        for index, (W, q, mu) in enumerate(problems):
            if len(mu) == 0:
                continue
            robot = world._robots[index]
            fields = {
                "step": round(start / world.time_step),
                "index": index,
                "robot": re.sub(r"[^\w.-]", "_", robot.name),
                "time": start,
            }
            path = self._pattern.format(**fields)
            if path in written:
                raise ValueError(
                    f"{path}: is the file of {written[path]} and of {robot.name} in the same step; put {{robot}} or {{index}} into "
                    "the pattern"
                )
            written[path] = robot.name
            # Contacts are with level ground, so world axes are contact axes.
            impulse = np.concatenate([contact.impulse for contact in robot.contacts])
            problem = fclib.LocalProblem(W, q, mu, solution=fclib.Solution(u=W @ impulse + q, r=impulse))
            os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
            fclib.write(path, problem, **_texts(world, robot, fields))


def _pattern(path: str) -> str:
    """The pattern of file names that a folder or a pattern stands for."""
    if "{" not in path and "}" not in path:
        if os.path.exists(path) and not os.path.isdir(path):
            raise NotADirectoryError(f"{path}: is a file; give a folder, or a pattern with {{step}}")
        os.makedirs(path, exist_ok=True)
        return os.path.join(path, _DEFAULT)
    used = set()

    class Sample(dict):
        def __missing__(self, name: str) -> Any:
            raise ValueError(f"unknown field {name!r}")

        def __getitem__(self, name: str) -> Any:
            used.add(name)
            return super().__getitem__(name)

    try:
        path.format_map(Sample(step=0, index=0, robot="robot", time=0.0))
    except (ValueError, IndexError, KeyError, AttributeError, TypeError) as error:
        raise ValueError(
            f"path is {path!r}: {error}; a pattern has the fields {', '.join('{' + name + '}' for name in _FIELDS)}, "
            "as in '{step:06d}_{robot}.hdf5'"
        ) from None
    if not used & {"step", "time"}:
        raise ValueError(
            f"path is {path!r}: every step would overwrite the last; put {{step}} into it, as in '{{step:06d}}.hdf5'"
        )
    return path


def _texts(world: World, robot: Robot, fields: dict[str, Any]) -> dict[str, str]:
    info = robot.solve_info
    status = "converged" if StepStatus.NOT_CONVERGED not in info.status else "not converged"
    part = f" (the last of {info.substeps} substeps)" if info.substeps > 1 else ""
    return {
        "title": f"{robot.name}, step {fields['step']}, t = {fields['time']:.9g} s",
        "description": (
            f"Recorded by stickslip {_VERSION} from a world with integrator {world.integrator}: contacts of robot {fields['index']}, "
            f"{robot.name}, in the step{part} from t = {fields['time']:.17g} s, time step {world.time_step:.17g} s. SI units, r is an "
            f"impulse [N s]. The solution is the solver's (method {world._method}, law {world._law}): {status}, largest contact residual "
            f"{info.residual:.3g} m/s."
        ),
        "math_info": "W = J M^-1 J', symmetric positive semidefinite",
    }
