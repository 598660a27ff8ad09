"""Results as tables on the screen and in Markdown: the same cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rich import box
from rich.table import Table
from rich.text import Text

from stickslip.bench.measuring import Result, Speed


@dataclass(frozen=True)
class Cells:
    """One table: heads, and rows of text. The first `words` columns are words, the others numbers."""

    words: int
    heads: tuple[str, ...]
    rows: list[tuple[str, ...]]


def speeds(results: Sequence[Result]) -> Cells:
    """How fast, beside MuJoCo."""
    heads = ("task", "engine", "threads", "robots", "us per\nrobot-step", "robot-steps\nper second", "times\nreal time")
    rows = []
    for r in results:
        name = f"stickslip {r.dtype} {r.instruction_set}"
        rows.append((r.task, name, *_speed(r.speed), ""))
        rows += [("", s.engine, *_speed(s), "" if s.ratio is None else f"{s.ratio:.1f}") for s in r.mujoco]
    return Cells(2, (*heads, "stickslip is\nfaster by"), rows)


def stages(results: Sequence[Result]) -> Cells:
    """Where the time goes."""
    names = list(results[0].stages_us) if results else []
    heads = ("task", *(f"{name}\n[us]" for name in names), "all\n[us]")
    rows = [
        (r.task, *(f"{r.stages_us[name]:.3f}" for name in names), f"{sum(r.stages_us.values()):.3f}") for r in results
    ]
    return Cells(1, heads, rows)


def residuals(results: Sequence[Result]) -> Cells:
    """How well contacts were solved, and what failed."""
    quantiles = list(results[0].watched.residual_quantiles) if results else []
    heads = ("task", "robot-steps", "contacts", *(_quantile(q) for q in quantiles))
    heads += ("above\ntolerance", "not\nflagged", "not\nconverged", "not\nfinite")
    rows = []
    for r in results:
        w = r.watched
        values = (f"{w.residual_quantiles[q]:.1e}" for q in quantiles)
        counts = (w.above_tolerance, w.above_unflagged, w.not_converged, w.non_finite)
        rows.append((r.task, str(w.robot_steps), f"{w.contacts:.2f}", *values, *map(str, counts)))
    return Cells(1, heads, rows)


def rich_table(cells: Cells, title: str) -> Table:
    """For the screen."""
    table = Table(
        box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0), header_style="bold", title=title
    )
    table.title_justify = "left"
    for k, head in enumerate(cells.heads):
        justify = "left" if k < cells.words else "right"
        table.add_column(Text(head, justify=justify), justify=justify, no_wrap=True)
    for row in cells.rows:
        table.add_row(*(Text(cell) for cell in row))
    return table


def markdown(cells: Cells) -> str:
    """For documents."""
    heads = [head.replace("\n", " ") for head in cells.heads]
    rules = ["---" if k < cells.words else "---:" for k in range(len(heads))]
    lines = [heads, rules, *([cell.replace("|", "\\|") for cell in row] for row in cells.rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _speed(s: Speed) -> tuple[str, ...]:
    return (
        str(s.threads),
        str(s.envs),
        f"{s.us:.3f}",
        f"{s.robot_steps_per_s / 1e6:.3f} M",
        f"{s.real_time_factor:,.0f}".replace(",", " "),
    )


def _quantile(text: str) -> str:
    return "residual\nmax [m/s]" if text == "1" else f"residual\n{100 * float(text):g} % [m/s]"
