"""Solvers compared on contact problems: what the command `stickslip solve` does. See docs/solve.md.

`run` solves and times, `performance_profile` and `summary` count, `draw_profile` and `draw_histories` draw (matplotlib loads
there, and only there).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from stickslip.compare_solvers.profile import Profile, performance_profile
from stickslip.compare_solvers.running import Record, methods_for, numerical_rank, run
from stickslip.compare_solvers.table import Summary, summary, write_csv

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = [
    "Profile",
    "Record",
    "Summary",
    "draw_histories",
    "draw_profile",
    "methods_for",
    "numerical_rank",
    "performance_profile",
    "run",
    "summary",
    "write_csv",
]


def draw_profile(records: Iterable[Record], path: Path | str) -> Path:
    """Writes a picture of the performance profile (PNG, PDF or SVG, as the path ends); returns the path."""
    from stickslip.compare_solvers import plots

    return plots.draw_profile(list(records), Path(path))


def draw_histories(records: Iterable[Record], path: Path | str) -> Path:
    """Writes a picture of the best residual so far over time, one panel per problem; returns the path.

    Of records that were run with `history=True`; ValueError for others.
    """
    from stickslip.compare_solvers import plots

    return plots.draw_histories(list(records), Path(path))
