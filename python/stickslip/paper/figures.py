"""One look for all figures."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg", force=False)
import matplotlib.pyplot as plt

INK, MUTED, RULE = "#20242c", "#6b7280", "#e3e6eb"

_STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 10,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": "#b9bfc9",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlepad": 8,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "axes.axisbelow": True,
    "grid.color": RULE,
    "grid.linewidth": 0.8,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.size": 3,
    "ytick.major.size": 0,
    "xtick.minor.size": 0,
    "legend.frameon": False,
    "lines.linewidth": 1.8,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


def new(rows: int = 1, columns: int = 1, *, width: float = 7.6, height: float = 3.6, **options):
    """A figure and its axes (always as an array, row-major)."""
    with plt.rc_context(_STYLE):
        figure, axes = plt.subplots(
            rows, columns, figsize=(width, height), squeeze=False, layout="constrained", **options
        )
    return figure, axes.ravel()


def save(figure, path: Path, resolution: int = 170) -> Path:
    """Writes a PNG and forgets the figure."""
    with plt.rc_context(_STYLE):
        figure.savefig(path, dpi=resolution)
    plt.close(figure)
    return path


def title(axis, text: str, size: float = 11) -> None:
    """Above the panel, at its left."""
    axis.set_title(text, loc="left", fontsize=size, fontweight="bold", color=INK)


def legend_above(figure, handles, labels, columns: int | None = None) -> None:
    """One legend for all panels, above them."""
    with plt.rc_context(_STYLE):
        figure.legend(
            handles, labels, loc="outside upper left", ncols=columns or len(labels), handlelength=1.2, columnspacing=1.6
        )
