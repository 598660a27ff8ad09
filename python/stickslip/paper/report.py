"""Runs the experiments one after the other and writes the report."""

from __future__ import annotations

import html
import json
import math
import re
import time
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from stickslip.paper import claims, fifty_hertz, fig5, fig6, fig7, machine, page, published, strips, table1, table2
from stickslip.paper.methods import TASKS
from stickslip.paper.settings import Settings
from stickslip.paper.words import geometric_mean, millimetres, number, percent

#: In the order of the report; each has TITLE, work, measure, draw, section.
EXPERIMENTS = {
    "tasks": strips,
    "table1": table1,
    "table2": table2,
    "fig5": fig5,
    "fig6": fig6,
    "fig7": fig7,
    "fifty_hertz": fifty_hertz,
}
#: Timings first, alone on the machine; pictures last.
_RUN_ORDER = ("table1", "table2", "fig5", "fig6", "fig7", "fifty_hertz", "tasks")


def write_report(folder: Path, settings: Settings, check: bool = False) -> int:
    """Measures, draws, writes; returns an exit status, 1 if `check` is on and a claim was missed."""
    folder.mkdir(parents=True, exist_ok=True)
    console = Console()
    start = time.perf_counter()
    results: dict = {"settings": asdict(settings), "machine": machine.describe()}
    columns = (
        TextColumn("{task.description:<34}"),
        BarColumn(32),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console) as progress:
        bars = {
            key: progress.add_task(EXPERIMENTS[key].TITLE, total=EXPERIMENTS[key].work(settings), start=False)
            for key in _RUN_ORDER
        }
        for key in _RUN_ORDER:
            experiment, bar = EXPERIMENTS[key], bars[key]
            progress.start_task(bar)

            def tick(n: int, bar=bar) -> None:
                progress.advance(bar, n)

            results[key] = experiment.measure(settings, tick)
            if experiment is strips:
                strips.draw(results[key], folder, tick)
            else:
                experiment.draw(results[key], folder)
            progress.update(bar, completed=experiment.work(settings))
    results["seconds"] = time.perf_counter() - start
    (folder / "results.json").write_text(
        json.dumps(_plain(results), indent=1, allow_nan=False) + "\n", encoding="utf-8"
    )
    write_page(folder, results)
    console.print(f"\n{folder / 'report.html'} and its data, in {results['seconds']:.0f} s\n")
    for value, what in _headlines(results):
        console.print(f"  [bold]{_text(value):>14}[/]  {_text(what)}", soft_wrap=True)
    broken = claims.missed(results) if check else []
    for sentence in broken:
        console.print(f"MISSED: {sentence}", soft_wrap=True, highlight=False)
    return 1 if broken else 0


def write_page(folder: Path, results: dict) -> None:
    """Only the page, from results and pictures that are there."""
    facts = results["machine"]
    parts = [(key, e.TITLE, e.section(results[key])) for key, e in EXPERIMENTS.items()]
    full = results["settings"]["name"] == "full"
    lead = (
        'The experiments of Hwangbo, Lee and Hutter, <a href="https://doi.org/10.1109/LRA.2018.2792536">Per-Contact Iteration Method for Solving '
        "Contact Dynamics</a> (RA-L 2018), run by stickslip on the ANYmal robot and put beside the paper's numbers. "
        + (
            "With the paper's sample counts."
            if full
            else "A quick run with fewer samples; <code>stickslip paper --full</code> takes the paper's counts."
        )
    )
    names = {
        "processor": "Processor",
        "compiler": "Compiler",
        "system": "System",
        "stickslip": "stickslip",
        "python": "Python",
        "numpy": "NumPy",
    }
    foot = (
        "<dl>"
        + "".join(f"<dt>{names[k]}</dt><dd>{facts[k]}</dd>" for k in names)
        + f"<dt>Run</dt><dd>{number(results['seconds'], 3)} s, one thread for everything that is timed</dd>"
        + f"<dt>Paper</dt><dd>{published.PROCESSOR}</dd></dl>All numbers on this page were measured in this run, except those marked as the paper's; "
        "<code>results.json</code> has them all."
    )
    page.write(
        folder / "report.html",
        title="The paper, running",
        lead=lead,
        top=page.cards(_headlines(results)),
        parts=parts,
        foot=foot,
    )


def _headlines(results: dict) -> list[tuple[str, str]]:
    """The numbers to remember."""
    one, steps, laws, hang, large = (results[k] for k in ("table1", "table2", "fig6", "fig7", "fifty_hertz"))
    out = []
    solved = [d["methods"] for d in one["tasks"].values() if d["methods"]]
    if solved:
        ns = {m: geometric_mean([d[m]["ns_per_solve"] for d in solved]) for m in ("bisection", "halley")}
        out.append(
            (
                f"{number(ns['halley'], 2)} ns",
                f"per sliding contact with Halley's method; bisection {number(ns['bisection'], 2)} ns, paper 580 ns",
            )
        )
    micro = {
        m: [10 * steps["tasks"][t][m]["seconds_per_100k_steps"] for t in TASKS] for m in ("bisection", "energy_safe")
    }
    theirs = [10 * v for v in published.STEPS_100K["bisection"].values()]
    out.append(
        (
            f"{number(min(micro['energy_safe']), 2)}–{number(max(micro['energy_safe']), 2)} µs",
            f"per default step of the four tasks; paper {number(min(theirs), 2)}–{number(max(theirs), 2)} µs",
        )
    )
    fewer = [steps["tasks"][t]["pgs"]["mean"] / max(steps["tasks"][t]["bisection"]["mean"], 1e-9) for t in TASKS]
    out.append(
        (
            f"{number(min(fewer), 2)}–{number(max(fewer), 2)} ×",
            "fewer sweeps by per-contact iteration than by PGS, mean per task",
        )
    )
    sliding = sum(d["sliding"]["contacts"] for d in laws["tasks"].values())
    if sliding:
        below = (
            sum(d["sliding"]["contacts"] * d["sliding"]["below_1_percent"] for d in laws["tasks"].values()) / sliding
        )
        out.append(
            (
                percent(below),
                "of sliding contacts agree within 1 % under the two friction laws; paper 99.6 % of all contacts",
            )
        )
    ours, plain = hang["cases"]["energy_safe"]["mean_mm"], hang["cases"]["bisection"]["mean_mm"]
    out.append(
        (
            f"{millimetres(ours / 1e3)} mm",
            f"mean penetration of hanging feet; {number(plain, 2)} mm with the paper's step",
        )
    )
    last = {i: large["cases"]["drop"][i][-1] for i in ("semi_implicit", "energy_safe")}
    dt = 1e3 * large["time_steps"][-1]
    out.append(
        (
            f"{last['energy_safe']['exploded']} of {last['energy_safe']['episodes']}",
            f"drops explode at {dt:g} ms; {last['semi_implicit']['exploded']} of {last['semi_implicit']['episodes']} with the paper's step",
        )
    )
    return out


def _text(markup: str) -> str:
    return html.unescape(re.sub(r"<sup>(.*?)</sup>", r"^\1", markup))


def _plain(value):
    """JSON has no infinities."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
