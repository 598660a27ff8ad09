"""Solving problems with several methods, and timing it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from stickslip.contact import SOLVE_METHODS, ContactProblem, ContactSolution, History, Law, SolveMethod, solve

#: Problems with more rows have no rank in the table: it costs more than the solve.
LARGEST_RANKED = 3000

# A short solve is repeated until it took this long in all [s], or this often; the first one also fills the caches.
_LONG_ENOUGH, _REPEATS = 0.05, 9


@dataclass(frozen=True)
class Record:
    """One problem solved with one method."""

    problem: str  #: its name
    contacts: int
    rank: int | None  #: of the Delassus operator, see `numerical_rank`; None where it is too large
    method: str
    law: str
    stage: str  #: what found the impulse
    iterations: int  #: sweeps, steps and iterations of all stages, added
    time: float  #: median wall time of a call of `solve` [s]
    residual: float  #: largest contact residual [m/s]
    relative_residual: float  #: residual over the largest |free_velocity|
    backward_error: float  #: least change of the contact velocities that makes the impulse exact [m/s]
    tolerance: float  #: on the residual [m/s], relative part included
    status: str  #: of the solve: "converged", "iteration_limit", "stalled" or "infeasible"
    history: History | None = field(default=None, repr=False, compare=False)  #: if asked for

    @property
    def solved(self) -> bool:
        """The residual is within the tolerance."""
        return self.status == "converged"


def run(
    problems: Mapping[str, ContactProblem] | Iterable[ContactProblem | tuple[str, ContactProblem]],
    methods: SolveMethod | Sequence[SolveMethod] = "auto",
    law: Law = "coulomb",
    tolerance: float = 0.0,
    relative_tolerance: float = 1e-8,
    *,
    history: bool = False,
    progress: Callable[[Record], None] | None = None,
    **options: Any,
) -> list[Record]:
    """Solves every problem with every method; one record each, problem by problem in the order given.

    problems: by name, as pairs (name, problem), or without names: those are numbered. An iterator is drawn from one by one.
    methods: of `solve`, one or several.
    law, tolerance [m/s], relative_tolerance: of `solve`.
    history: keep the course of each solve, recorded in a solve of its own that is not timed.
    progress: called with each record as it is made.
    options: more options of `solve` (max_sweeps, max_iterations, minimum_norm, ...).

    ValueError or TypeError, before anything is solved, for options that `solve` refuses; ValueError for a name that comes twice.
    """
    names = [methods] if isinstance(methods, str) else list(methods)
    if not names:
        raise ValueError("methods is empty; give at least one")
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise ValueError(f"methods has {repeated[0]!r} twice")
    options |= {"law": law, "tolerance": tolerance, "relative_tolerance": relative_tolerance}
    unit = ContactProblem(np.eye(3), [0.0, 0.0, -1.0], [0.5])
    for name in names:
        solve(unit, method=name, **options)  # raises what it would raise for any problem

    records: list[Record] = []
    seen: set[str] = set()
    for label, problem in _named(problems):
        if label in seen:
            raise ValueError(f"problems has the name {label!r} twice; names tell problems apart")
        seen.add(label)
        rank = numerical_rank(problem)
        for name in names:
            records.append(_solved(label, problem, rank, {"method": name, **options}, history))
            if progress is not None:
                progress(records[-1])
    return records


def methods_for(law: Law) -> tuple[SolveMethod, ...]:
    """The methods that solve problems with this law."""
    return SOLVE_METHODS if law == "coulomb" else ("auto", "per_contact")


def numerical_rank(problem: ContactProblem) -> int | None:
    """Eigenvalues of the Delassus operator above the rounding of the largest one; None above `LARGEST_RANKED` rows.

    Rounding: (number of rows) * 2.2e-16 times the largest eigenvalue.
    """
    rows = 3 * problem.num_contacts
    if rows > LARGEST_RANKED:
        return None
    if rows == 0:
        return 0
    try:
        return int(np.linalg.matrix_rank(problem.dense_delassus(), hermitian=True))
    except np.linalg.LinAlgError:
        return None


def _named(problems: Any) -> Iterator[tuple[str, ContactProblem]]:
    pairs = problems.items() if isinstance(problems, Mapping) else problems
    if isinstance(pairs, ContactProblem):
        raise TypeError("problems is a ContactProblem; put it into a list")
    for k, item in enumerate(pairs):
        label, problem = item if isinstance(item, tuple) else (str(k), item)
        if not isinstance(problem, ContactProblem):
            raise TypeError(f"problems[{label}] is a {type(problem).__name__}; a ContactProblem is wanted")
        yield str(label), problem


def _solved(label: str, problem: ContactProblem, rank: int | None, options: dict[str, Any], history: bool) -> Record:
    time, solution = _timed(problem, options)
    speed = float(np.abs(problem.free_velocity).max(initial=0.0))
    residual = solution.residual
    return Record(
        problem=label,
        contacts=problem.num_contacts,
        rank=rank,
        method=options["method"],
        law=options["law"],
        stage=solution.stage,
        iterations=solution.iterations,
        time=time,
        residual=residual,
        relative_residual=residual / speed if speed > 0 else 0.0 if residual == 0 else float("inf"),
        backward_error=solution.certificate.backward_error,
        tolerance=options["tolerance"] + options["relative_tolerance"] * speed,
        status=solution.status,
        history=_history(problem, options) if history else None,
    )


def _timed(problem: ContactProblem, options: dict[str, Any]) -> tuple[float, ContactSolution]:
    times: list[float] = []
    while _again(times):
        begin = perf_counter()
        solution = solve(problem, **options)
        times.append(perf_counter() - begin)
    return median(times), solution


def _history(problem: ContactProblem, options: dict[str, Any]) -> History:
    """Of the fastest of some solves, which differ in nothing but their times."""
    recorded: list[History] = []
    while _again([float(h.time[-1]) for h in recorded]):
        recorded.append(solve(problem, **{**options, "history": True}).history)
    return min(recorded, key=lambda h: h.time[-1])


def _again(times: list[float]) -> bool:
    return len(times) < _REPEATS and sum(times) < _LONG_ENOUGH
