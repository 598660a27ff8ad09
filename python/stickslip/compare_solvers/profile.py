"""Performance profiles: many problems, several methods, one picture.

The profile of a method is the share of problems that it solves within a factor tau of the time of the fastest method on that
problem (Dolan and Moré, "Benchmarking optimization software with performance profiles", 2002). At tau = 1 it says how often the
method is the fastest, at the right end how often it solves at all.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.compare_solvers.running import Record


@dataclass(frozen=True)
class Profile:
    """A step function: `share[i]` from `tau[i]` up to `tau[i + 1]`, the last one for ever."""

    tau: NDArray[np.float64]  #: (k,) ascending factors, the first is 1
    share: NDArray[np.float64]  #: (k,) of all problems, 0 to 1, never decreasing


def performance_profile(records: Iterable[Record]) -> dict[str, Profile]:
    """The profile of each method, in the order in which methods first appear.

    A problem that no method solves counts among all problems. ValueError unless every method has one record of every problem.
    """
    times: dict[str, dict[str, float]] = {}
    for record in records:
        of_method = times.setdefault(record.method, {})
        if record.problem in of_method:
            raise ValueError(f"records has {record.method!r} twice for the problem {record.problem!r}")
        of_method[record.problem] = record.time if record.solved else np.inf
    problems = list(dict.fromkeys(name for of_method in times.values() for name in of_method))
    for method, of_method in times.items():
        missing = [name for name in problems if name not in of_method]
        if missing:
            raise ValueError(
                f"records has no {method!r} for the problem {missing[0]!r}; run all methods on all problems"
            )
    if not problems:
        return {}
    table = np.array([[of_method[name] for name in problems] for of_method in times.values()])
    table = np.maximum(table, 1e-9)  # a clock that stood still
    fastest = table.min(axis=0)
    ratios = np.where(np.isfinite(table), table / np.where(np.isfinite(fastest), fastest, 1.0), np.inf)
    return {method: _profile(row) for method, row in zip(times, ratios, strict=True)}


def _profile(ratios: NDArray[np.float64]) -> Profile:
    tau = np.unique(np.append(ratios[np.isfinite(ratios)], 1.0))
    return Profile(tau, np.searchsorted(np.sort(ratios), tau, side="right") / len(ratios))
