"""The command `stickslip solve`, behind its arguments."""

from __future__ import annotations

import argparse
import itertools
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from stickslip.compare_solvers import draw_histories, draw_profile
from stickslip.compare_solvers.running import Record, methods_for, run
from stickslip.compare_solvers.sources import distinct, family, find_files, generated, loaded, printable
from stickslip.compare_solvers.table import records_table, summary, summary_table, write_csv
from stickslip.contact import SOLVE_METHODS, ContactProblem

#: With more problems than this the picture is a performance profile.
MOST_PANELS = 6
SOLVED, NOT_SOLVED, BAD_INPUT = 0, 1, 2
#: The table does not become narrower [characters].
NARROWEST = 116
PICTURES = (".png", ".pdf", ".svg")


def solve_command(arguments: argparse.Namespace) -> int:
    """Solves, prints, writes and draws; returns the exit status."""
    try:
        methods = _methods(arguments.method, arguments.law)
        options = _options(arguments)
        run([], methods, **options)
        families = [family(text, arguments.count, arguments.seed) for text in dict.fromkeys(arguments.family)]
        _check_outputs(arguments)
    except (TypeError, ValueError, OSError) as error:
        return _refuse(str(error).removeprefix("SolveOptions."))
    if not arguments.files and not families:
        return _refuse("give files, folders or patterns of FCLIB problems, or --family NAME for generated ones")

    paths, errors = find_files(arguments.files)
    errors, notes = [printable(text) for text in errors], []
    number = len(paths) + sum(f.count for f in families)
    curves = bool(arguments.plot) and number <= MOST_PANELS
    problems = distinct(itertools.chain(loaded(paths, errors, notes), generated(families)))
    records = _run(problems, number, methods, options, history=curves)
    if records:
        _print(records)
    for text in notes + errors:
        print(f"stickslip solve: {text}", file=sys.stderr)
    try:
        _write(records, arguments, curves)
    except OSError as error:
        return _refuse(str(error))
    if errors:
        return BAD_INPUT
    return SOLVED if all(r.solved for r in records) else NOT_SOLVED


def _methods(given: Sequence[str], law: str) -> list[str]:
    """Names, also behind commas, each once; "all" is every method that knows the law."""
    names = [name for text in given for name in text.split(",") if name]
    for name in names:
        if name not in (*SOLVE_METHODS, "all"):
            hint = "; files come before --method, or behind --" if Path(name).exists() or "." in name else ""
            raise ValueError(f"--method {name!r}: choose among {', '.join(SOLVE_METHODS)} and all{hint}")
    spread = [each for name in names for each in (methods_for(law) if name == "all" else [name])]
    return list(dict.fromkeys(spread)) or ["auto"]


def _options(arguments: argparse.Namespace) -> dict[str, Any]:
    options = {name: getattr(arguments, name) for name in ("law", "tolerance", "relative_tolerance", "minimum_norm")}
    for name in ("max_sweeps", "max_iterations"):
        if getattr(arguments, name) is not None:
            options[name] = getattr(arguments, name)
    return options


def _check_outputs(arguments: argparse.Namespace) -> None:
    """Before the work, not after it."""
    for option, path in (("--plot", arguments.plot), ("--csv", arguments.csv)):
        if path is None:
            continue
        if path.is_dir():
            raise ValueError(f"{option} {path}: is a folder; give the path of a file")
        if not path.parent.is_dir():
            raise ValueError(f"{option} {path}: the folder {path.parent} does not exist")
    if arguments.plot is not None and arguments.plot.suffix.lower() not in PICTURES:
        raise ValueError(f"--plot {arguments.plot}: the name must end in one of {', '.join(PICTURES)}")


def _run(
    problems: Iterable[tuple[str, ContactProblem]],
    number: int,
    methods: list[str],
    options: dict[str, Any],
    history: bool,
) -> list[Record]:
    console = Console(stderr=True)
    columns = TextColumn("solving"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=number * len(methods))
        return run(problems, methods, history=history, progress=lambda _: bar.advance(task), **options)


def _print(records: list[Record]) -> None:
    console = Console(highlight=False)
    # Away from a terminal every row is one line; a narrow terminal wraps lines rather than lose digits.
    width = max(console.width, NARROWEST) if console.is_terminal else 1000
    console = Console(highlight=False, width=width, height=25)  # without a height, dumb terminals get 80 columns
    with console.capture() as captured:
        console.print(records_table(records))
        if len({r.problem for r in records}) > 1:
            console.print()
            console.print(summary_table(summary(records)))
    text = "\n".join(line.rstrip() for line in captured.get().splitlines())
    encoding = console.encoding  # which may have no letters for the name of a file
    try:
        print(text.encode(encoding, "backslashreplace").decode(encoding), flush=True)
    except BrokenPipeError:  # the reader, such as head, has seen enough; what is left of the text goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _write(records: list[Record], arguments: argparse.Namespace, curves: bool) -> None:
    if arguments.csv is not None:
        write_csv(records, arguments.csv)
    if arguments.plot is not None and records:
        draw = draw_histories if curves else draw_profile
        draw(records, arguments.plot)


def _refuse(reason: str) -> int:
    print(f"stickslip solve: {printable(reason)}", file=sys.stderr)
    return BAD_INPUT
