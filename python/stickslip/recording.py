"""Contact problems that a world meets, written to FCLIB files while it steps."""

from __future__ import annotations

import glob
import os
import re
import string
from collections.abc import Iterable
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from stickslip import fclib
from stickslip._arguments import count
from stickslip.fclib.hdf5 import path_of
from stickslip.reports import StepStatus

if TYPE_CHECKING:
    from stickslip.world import Robot, World

_VERSION = version("stickslip")
_FIELDS = ("number", "step", "index", "robot", "time")
_DEFAULT = "problem{number:06d}_robot{index}_{robot}.hdf5"


class Recorder:
    """Steps a world and writes the problems of every `every`-th step that has contacts, one file per robot.

    path: a folder (made if missing), or a pattern of file names like "drop/{number:06d}_{robot}.hdf5" with the fields number,
        step, index, robot and time.

    number counts the recorded steps, on from the files that are there: times repeat when a state is loaded, numbers do not.
    """

    def __init__(self, world: World, path: str | os.PathLike[str], every: int = 1):
        self._world = world
        self._every = count("every", every, least=1)
        self._pattern = _pattern(path_of(path))
        self._number = _first_free(self._pattern)
        self._seen = 0  # steps with contacts

    def step(self, steps: int) -> tuple[int, int]:
        """Steps the world as its core does: returns the status bits, or-ed, and the number of steps; an overflow ends them."""
        bits = done = 0
        while done < steps and StepStatus.NON_FINITE not in StepStatus(bits):
            bits |= self._step()
            done += 1
        return bits, done

    def _step(self) -> int:
        start = self._world.time
        bits, _ = self._world._core.step(1)
        if any(robot.solve_info.contacts for robot in self._world._robots):
            if self._seen % self._every == 0 and StepStatus.NON_FINITE not in StepStatus(bits):
                self._write(start)
            self._seen += 1
        return bits

    def _write(self, start: float) -> None:
        world = self._world
        problems = {k: world._core.last_contact_problem(k) for k in range(len(world._robots))}
        problems = {
            k: problem for k, problem in problems.items() if len(problem[1])
        }  # of robots that touch nothing: empty
        paths = self._paths(problems, start)
        while any(map(os.path.exists, paths)):  # somebody else records here too
            self._number += 1
            paths = self._paths(problems, start)
        for (index, ((W, q, mu), impulse)), path in zip(problems.items(), paths, strict=True):
            # Contacts are with level ground, so world axes are contact axes.
            problem = fclib.LocalProblem(W, q, mu, solution=fclib.Solution(u=W @ impulse + q, r=impulse))
            os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
            fclib.write(path, problem, **_texts(world, world._robots[index], self._fields(index, start)))
        self._number += 1

    def _paths(self, robots: Iterable[int], start: float) -> list[str]:
        """One for each of these robots, different from each other."""
        paths: dict[str, str] = {}
        for index in robots:
            path, name = self._pattern.format(**self._fields(index, start)), self._world._robots[index].name
            if path in paths:
                raise ValueError(
                    f"{path}: is the file of {paths[path]} and of {name} in the same step; put {{robot}} or {{index}} into "
                    "the pattern"
                )
            paths[path] = name
        return list(paths)

    def _fields(self, index: int, start: float) -> dict[str, Any]:
        return {
            "number": self._number,
            "step": round(start / self._world.time_step),
            "index": index,
            "robot": re.sub(r"[^\w.-]", "_", self._world._robots[index].name),
            "time": start,
        }


def _pattern(path: str) -> str:
    """The pattern of file names that a folder or a pattern stands for."""
    if "{" not in path and "}" not in path:
        if path.endswith((".hdf5", ".h5")):
            raise ValueError(
                f"path is {path!r}: one file cannot hold the problems of several steps; give a folder, or put {{number}} into "
                "the name, as in '{number:06d}.hdf5'"
            )
        if os.path.exists(path) and not os.path.isdir(path):
            raise NotADirectoryError(f"{path}: is a file; give a folder, or a pattern with {{number}}")
        os.makedirs(path, exist_ok=True)
        return os.path.join(path, _DEFAULT)
    wanted = f"a pattern has the fields {', '.join('{' + name + '}' for name in _FIELDS)}, as in '{{number:06d}}_{{robot}}.hdf5'"
    try:
        path.format_map(_Sample(number=0, step=0, index=0, robot="robot", time=0.0))
    except (ValueError, IndexError, KeyError, AttributeError, TypeError) as error:
        raise ValueError(f"path is {path!r}: {error}; {wanted}") from None
    formats = [form or "" for _, name, form, _ in string.Formatter().parse(path) if name == "number"]
    if not formats:
        raise ValueError(
            f"path is {path!r}: files of different steps would have the same name; put {{number}} into it, as in "
            "'{number:06d}.hdf5'"
        )
    for form in formats:
        if not re.fullmatch(r"0?[0-9]*d?", form):
            raise ValueError(f"path is {path!r}: {{number:{form}}} is not a width, as in {{number:06d}}")
    return path


class _Sample(dict):
    def __missing__(self, name: str) -> Any:
        raise ValueError(f"unknown field {name!r}")


def _first_free(pattern: str) -> int:
    """One more than the largest number of the files that the pattern names, whatever their other fields; 0 without any."""
    wild = expression = ""
    for text, name, _, _ in string.Formatter().parse(pattern):
        wild += glob.escape(text)
        expression += re.escape(text)
        if name is not None:
            wild += "*"
            expression += r"\s*(\d+)" if name == "number" else ".*?"
    found = (re.fullmatch(expression, path, re.DOTALL) for path in glob.iglob(wild))
    return max((int(match[1]) + 1 for match in found if match), default=0)


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
