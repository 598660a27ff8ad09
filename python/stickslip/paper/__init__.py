"""The experiments of [Hwangbo 2018] on ANYmal, and a report that puts them beside the paper's.

`run` is what the command `stickslip paper` and `make run` do.
"""

from __future__ import annotations

from pathlib import Path

from stickslip.paper.settings import Settings, full, quick, tiny

__all__ = ["Settings", "full", "quick", "run", "tiny"]


def run(
    output: Path | str = "report", full: bool = False, settings: Settings | None = None, check: bool = False
) -> int:
    """Runs everything and writes report.html, PNGs and results.json into the folder `output`; returns an exit status.

    check: 1 if the run misses a claim on Tables I and II (stickslip/paper/claims.py); each is printed.
    """
    from stickslip.paper.report import write_report

    if settings is None:
        settings = globals()["full"]() if full else quick()
    return write_report(Path(output), settings, check)
