"""The tasks and the four ways of stepping them that the report compares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.scenes import Scene

TASKS: dict[str, str] = {"trot": "Trot", "hang": "Hang", "drop": "Drop", "random": "Random"}


@dataclass(frozen=True)
class Method:
    """One way of stepping."""

    label: str
    short: str  #: for a figure's axis
    color: str
    options: dict  #: of `stickslip.World`


_PAPER = {"integrator": "semi_implicit", "tolerance": 1e-6}
METHODS: dict[str, Method] = {
    "bisection": Method(
        "Bisection",
        "Bisection",
        "#3566a8",
        {**_PAPER, "method": "per_contact", "law": "max_dissipation", "single_contact": "bisection"}
        | {"alpha": 1.0, "gamma": 0.99, "alpha_min": 0.7},
    ),
    "pgs": Method("PGS", "PGS", "#c8553d", {**_PAPER, "method": "pgs", "law": "coulomb", "alpha": 0.6}),
    "semi_implicit": Method("Ours, the paper's step", "Ours, plain", "#7fb7a3", {"integrator": "semi_implicit"}),
    "energy_safe": Method("Ours, default", "Ours", "#1f8a70", {"integrator": "energy_safe"}),
}


@dataclass(frozen=True)
class Records:
    """One array per quantity, an entry per step; see scenes/experiments.h."""

    contacts: NDArray[np.float64]
    sweeps: NDArray[np.float64]
    newton_steps: NDArray[np.float64]
    residual: NDArray[np.float64]
    penetration: NDArray[np.float64]
    impact: NDArray[np.bool_]
    converged: NDArray[np.bool_]
    episode_over: NDArray[np.bool_]


def scene_of(task: str, method: str, time_step: float = 1e-3, **changes) -> Scene:
    """A task stepped by a method; `changes` overrides options."""
    return Scene(task, time_step, **(METHODS[method].options | changes))


def advance(scene: Scene, steps: int) -> None:
    """Steps without statistics, in C++."""
    scene._task.run(scene.world._core, scene.robot._core, steps, None)


def record(scene: Scene, steps: int) -> Records:
    """Steps and says what each did."""
    columns = scene._task.record(scene.world._core, scene.robot._core, steps).T
    numbers, flags = columns[:5], columns[5:] > 0
    return Records(*numbers, *flags)
