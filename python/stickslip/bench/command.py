"""The command `stickslip bench`, behind its arguments."""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from pathlib import Path
from typing import Any

from rich.console import Console

from stickslip._core import ModelError
from stickslip.bench import tables
from stickslip.bench.measuring import ROUNDS, Options, Result, measure, mujoco_is_installed
from stickslip.bench.tasks import TASKS, Task, anymal_task, urdf_task
from stickslip.paper.machine import describe

GOOD, FAULTY, BAD_INPUT = 0, 1, 2
#: Tables do not become narrower [characters].
NARROWEST = 116


def bench_command(arguments: argparse.Namespace) -> int:
    """Measures, prints and writes; returns the exit status."""
    try:
        options = _options(arguments)
        tasks = [_task(name, arguments.base) for name in dict.fromkeys(arguments.task or TASKS)]
        _check_output(arguments.json)
    except (TypeError, ValueError, OSError) as error:
        return _refuse(str(error))
    try:
        results = [_measure(task, options) for task in tasks]
    except ModelError as error:  # a batch cannot be made so
        return _refuse(str(error))
    machine = describe()
    _print(results, options, machine, arguments.markdown)
    if options.mujoco and not mujoco_is_installed():
        print("stickslip bench: MuJoCo is not installed; pip install mujoco to compare", file=sys.stderr)
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(_record(results, options, machine), indent=1) + "\n", encoding="utf-8")
    for result in results:
        for fault in result.faults:
            print(f"stickslip bench: {result.task}: {fault}", file=sys.stderr)
    return FAULTY if any(result.faults for result in results) else GOOD


def _refuse(reason: str) -> int:
    print(f"stickslip bench: {reason}", file=sys.stderr)
    return BAD_INPUT


def _options(arguments: argparse.Namespace) -> Options:
    names = ("envs", "threads", "dtype", "integrator", "steps", "instruction_set", "mujoco")
    return Options(**{name: getattr(arguments, name) for name in names})


def _task(name: str, base: str) -> Task:
    if name in TASKS:
        return anymal_task(name)
    path = Path(name)
    if path.suffix.lower() != ".urdf" and not path.is_file():
        raise ValueError(f"--task {name!r}: choose among {', '.join(TASKS)}, or give a URDF file")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            task = urdf_task(path, base)
        except ModelError as error:
            text = str(error)
            raise ValueError(text if name in text else f"{name}: {text}") from None
    for text in dict.fromkeys(str(w.message) for w in caught):
        print(f"stickslip bench: {text}", file=sys.stderr)
    return task


def _check_output(path: Path | None) -> None:
    """Before the work, not after it."""
    if path is None:
        return
    if path.is_dir():
        raise ValueError(f"--json {path}: is a folder; give the path of a file")
    if not path.parent.is_dir():
        raise ValueError(f"--json {path}: the folder {path.parent} does not exist")


def _measure(task: Task, options: Options) -> Result:
    console = Console(stderr=True)
    with warnings.catch_warnings(), console.status(task.name) as status:
        warnings.simplefilter("ignore", UserWarning)  # of the robot: told before
        return measure(task, options, say=lambda what: status.update(f"{task.name}: {what}"))


def _print(results: list[Result], options: Options, machine: dict[str, str], as_markdown: bool) -> None:
    all_tables = [
        ("", tables.speeds(results)),
        ("Thread time per robot-step, with profiling on", tables.stages(results)),
        ("Contact residuals and failures, steps watched one by one", tables.residuals(results)),
    ]
    head = (
        f"{machine['processor']}, {machine['cores']} cores; {options.integrator}, dt = 1 ms; medians of {ROUNDS} rounds of "
        f"{options.steps_of_round} steps, in turns; wall time"
    )
    if as_markdown:
        print(head, *(f"{title}\n\n{tables.markdown(cells)}".strip() for title, cells in all_tables), sep="\n\n")
        return
    console = Console(highlight=False)
    # Away from a terminal every row is one line; a narrow terminal wraps lines rather than lose digits.
    width = max(console.width, NARROWEST) if console.is_terminal else 1000
    console = Console(highlight=False, width=width, height=25)
    with console.capture() as captured:
        console.print(head, end="\n\n", soft_wrap=True)
        for title, cells in all_tables:
            console.print(tables.rich_table(cells, title))
            console.print()
    print("\n".join(line.rstrip() for line in captured.get().splitlines()).rstrip(), flush=True)


def _record(results: list[Result], options: Options, machine: dict[str, str]) -> dict[str, Any]:
    return {
        "machine": machine,
        "integrator": options.integrator,
        "time_step_s": 1e-3,
        "steps_per_round": options.steps_of_round,
        "results": [result.as_dict() for result in results],
    }
