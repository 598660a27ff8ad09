"""Records as a table on the screen and in a file, and their summary."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from rich import box
from rich.table import Table
from rich.text import Text

from stickslip.compare_solvers.running import Record

#: Columns of the CSV file: attributes of a record, but for the time, which is in ms as in the table.
COLUMNS = (
    "file",
    "contacts",
    "rank",
    "method",
    "law",
    "stage",
    "iterations",
    "time_ms",
    "residual",
    "relative_residual",
    "backward_error",
    "tolerance",
    "status",
)


@dataclass(frozen=True)
class Summary:
    """One method on all problems."""

    method: str
    problems: int
    solved: int  #: within the tolerance
    within_1e6: int  #: residual at most 1e-6 of the largest |free_velocity|
    within_1e8: int  #: 1e-8
    time: float  #: of all problems, solved or not, added [s]


def summary(records: Iterable[Record]) -> list[Summary]:
    """Counts per method, in the order in which methods first appear."""
    by_method: dict[str, list[Record]] = {}
    for record in records:
        by_method.setdefault(record.method, []).append(record)
    return [
        Summary(
            method=method,
            problems=len(own),
            solved=sum(r.solved for r in own),
            within_1e6=sum(_within(r, 1e-6) for r in own),
            within_1e8=sum(_within(r, 1e-8) for r in own),
            time=sum(r.time for r in own),
        )
        for method, own in by_method.items()
    ]


def records_table(records: Iterable[Record]) -> Table:
    """A row per problem and method; what is the same for all methods of a problem is said once."""
    table = _table()
    table.add_column("file", overflow="fold")
    for name in ("contacts", "rank"):
        table.add_column(name, justify="right", no_wrap=True)
    for name in ("method", "stage"):
        table.add_column(name, no_wrap=True)
    for name in ("iter-\nations", "time\n[ms]", "residual\n[m/s]", "over\nmax|c|", "backward\nerror [m/s]"):
        table.add_column(Text(name, justify="right"), justify="right", no_wrap=True)
    table.add_column("status", no_wrap=True)

    records = list(records)
    names = short_names(records)
    for name, group in groupby(records, key=lambda r: r.problem):
        of_problem = list(group)
        for k, r in enumerate(of_problem):
            shared = (names[name], str(r.contacts), "-" if r.rank is None else str(r.rank)) if k == 0 else ("", "", "")
            table.add_row(
                Text(shared[0]),  # Text: a name may hold what rich takes for markup
                *shared[1:],
                r.method,
                r.stage,
                str(r.iterations),
                milliseconds(r.time),
                *(f"{value:.1e}" for value in (r.residual, r.relative_residual, r.backward_error)),
                Text(r.status, style="green" if r.solved else "bold red"),
                end_section=len(of_problem) > 1 and k + 1 == len(of_problem),
            )
    return table


def summary_table(summaries: Iterable[Summary]) -> Table:
    """A row per method."""
    table = _table()
    table.add_column("method", no_wrap=True)
    for name in ("problems", "solved", "residual <=\n1e-6 max|c|", "residual <=\n1e-8 max|c|", "total time\n[ms]"):
        table.add_column(Text(name, justify="right"), justify="right", no_wrap=True)
    for s in summaries:
        counts = (_share(n, s.problems) for n in (s.solved, s.within_1e6, s.within_1e8))
        table.add_row(s.method, str(s.problems), *counts, milliseconds(s.time))
    return table


def write_csv(records: Iterable[Record], path: Path | str) -> Path:
    """Writes a row per record, numbers with all their digits; returns the path. OSError where it cannot be written."""
    with open(path, "w", newline="", encoding="utf-8", errors="backslashreplace") as file:
        rows = csv.writer(file)
        rows.writerow(COLUMNS)
        for r in records:
            special = {"file": r.problem, "rank": "" if r.rank is None else r.rank, "time_ms": 1e3 * r.time}
            rows.writerow([special[name] if name in special else getattr(r, name) for name in COLUMNS])
    return Path(path)


def short_names(records: Iterable[Record]) -> dict[str, str]:
    """Names of problems without folders where that still tells them apart."""
    names = list(dict.fromkeys(r.problem for r in records))
    last = [os.path.basename(name) or name for name in names]
    return dict(zip(names, last if len(set(last)) == len(last) else names, strict=True))


def milliseconds(seconds: float) -> str:
    """Three digits, never with an exponent."""
    value = 1e3 * seconds
    return f"{value:.0f}" if value >= 100 else f"{value:.1f}" if value >= 10 else f"{value:.3f}"


def _within(record: Record, share: float) -> bool:
    # A solve that stops at this tolerance compares products; its ratio may be larger by rounding.
    return record.relative_residual <= share * (1 + 1e-12)


def _share(number: int, of: int) -> str:
    """As a count and percent; 100.0 % is all of them and 0.0 % none."""
    percent = 100 * number / of
    if 0 < number < of:
        percent = min(max(percent, 0.1), 99.9)
    return f"{number} ({percent:.1f} %)"


def _table() -> Table:
    return Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0), header_style="bold")
