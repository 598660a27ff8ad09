"""Pictures of records."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator, PercentFormatter

from stickslip.compare_solvers.profile import Profile, performance_profile
from stickslip.compare_solvers.running import Record
from stickslip.compare_solvers.table import short_names
from stickslip.paper import figures

#: Colors and dashes, so that lines that lie on each other and prints in gray can be told apart.
LOOKS = {
    "auto": ("#1f8a70", "-"),
    "per_contact": ("#3566a8", (0, (6, 1.5))),
    "pgs": ("#c8553d", (0, (1.2, 1.2))),
    "prox_newton": ("#d9a13b", "-"),
    "interior_point": ("#7a5aa6", (0, (5, 1.5, 1.2, 1.5))),
    "admm": ("#20242c", (0, (3, 1.5))),
}
_LOWEST = 1e-18  #: where a residual of exactly 0 is drawn, at the lowest [m/s]


def draw_profile(records: Sequence[Record], path: Path) -> Path:
    """The performance profile: share of problems over the factor to the fastest method."""
    profiles = performance_profile(records)
    if not profiles:
        raise ValueError("records is empty; there is nothing to draw")
    figure, (axis,) = figures.new(width=7.2, height=4.0)
    end = max(10.0, 1.3 * max(p.tau[-1] for p in profiles.values()))
    for method, p in sorted(profiles.items(), key=lambda item: -item[1].share[-1]):
        color, dashes = LOOKS[method]
        axis.step(
            np.append(p.tau, end),
            np.append(p.share, p.share[-1]),
            where="post",
            color=color,
            linestyle=dashes,
            linewidth=2.6 if method == "auto" else 1.8,
            zorder=3 if method == "auto" else 2,
            label=f"{method} ({_percent(p)})",
            clip_on=False,
        )
    axis.set_xscale("log")
    axis.set_xlim(1, end)
    axis.set_ylim(0, 1)
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if end < 200 else (1.0,), numticks=20))
    axis.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axis.xaxis.set_minor_locator(NullLocator())
    axis.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
    axis.set_xlabel("allowed time, relative to the fastest method on the problem")
    axis.set_ylabel("share of problems solved")
    number = len({r.problem for r in records})
    figures.title(axis, f"{number} problems: solved within a factor of the fastest")
    axis.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, handlelength=2.6, title="method (solved)")
    return figures.save(figure, path, resolution=130)


def draw_histories(records: Sequence[Record], path: Path) -> Path:
    """Best residual so far over time, a panel per problem."""
    if not records or any(not r.history for r in records):
        raise ValueError("records has no histories; call run with history=True")
    by_problem: dict[str, list[Record]] = {}
    for r in records:
        by_problem.setdefault(r.problem, []).append(r)
    columns = min(len(by_problem), 2 if len(by_problem) in (2, 4) else 3)
    rows = math.ceil(len(by_problem) / columns)
    size = (
        {"width": 7.2, "height": 4.2} if len(by_problem) == 1 else {"width": 4.4 * columns, "height": 3.2 * rows + 0.5}
    )
    figure, axes = figures.new(rows, columns, **size)
    handles = {}
    names = short_names(records)
    for axis, (name, own) in zip(axes, by_problem.items(), strict=False):
        for r in own:
            handles.setdefault(r.method, _draw_history(axis, r))
        _dress(axis, names[name], own)
    for axis in axes[len(by_problem) :]:
        axis.set_visible(False)
    for text, marker in (("solved", "o"), ("not solved", "X")):
        handles[text] = Line2D([], [], color=figures.MUTED, marker=marker, linestyle="none", markersize=6)
    figures.legend_above(
        figure, list(handles.values()), list(handles), columns=4 if len(by_problem) == 1 else len(handles)
    )
    return figures.save(figure, path, resolution=130)


def _draw_history(axis, record: Record):
    """One curve, with a dot at its end where the problem was solved, and a cross where not."""
    color, dashes = LOOKS[record.method]
    best = np.maximum(np.minimum.accumulate(record.history.residual), _LOWEST)
    time = np.maximum(1e3 * record.history.time, 1e-4)
    (line,) = axis.step(time, best, where="post", color=color, linestyle=dashes, label=record.method)
    marker, size = ("o", 5) if record.solved else ("X", 7)
    axis.plot(
        time[-1],
        best[-1],
        marker=marker,
        markersize=size,
        color=color,
        markeredgecolor="white",
        clip_on=False,
        zorder=4,
    )
    return line


def _dress(axis, name: str, records: Sequence[Record]) -> None:
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.yaxis.set_minor_locator(NullLocator())
    tolerance = max(records[0].tolerance, _LOWEST)
    axis.axhline(tolerance, color=figures.MUTED, linewidth=0.9, linestyle=(0, (4, 3)), zorder=1)
    axis.annotate(
        "tolerance",
        (0, tolerance),
        xycoords=("axes fraction", "data"),
        xytext=(4, 3),
        textcoords="offset points",
        fontsize=8,
        color=figures.MUTED,
    )
    axis.set_xlabel("time [ms]")
    axis.set_ylabel("best residual so far [m/s]")
    short = name if len(name) <= 30 else f"{name[:14]}...{name[-13:]}"
    figures.title(axis, f"{short}, {records[0].contacts} contacts".replace("$", r"\$"), size=9)


def _percent(p: Profile) -> str:
    return f"{100 * p.share[-1]:.0f} %" if p.share[-1] in (0, 1) else f"{100 * p.share[-1]:.1f} %"
