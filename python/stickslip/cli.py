"""The command `stickslip`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from stickslip import __version__


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="stickslip", description="Robots with hard contacts and exact friction.")
    parser.add_argument("--version", action="version", version=f"stickslip {__version__}")
    commands = parser.add_subparsers(dest="command", required=True)

    paper = commands.add_parser(
        "paper",
        help="run the experiments of Hwangbo, Lee and Hutter (2018) and write a report",
        description="Runs the experiments of 'Per-Contact Iteration Method for Solving Contact Dynamics' on ANYmal and "
        "writes report.html, its pictures and results.json.",
    )
    paper.add_argument("--full", action="store_true", help="the paper's sample counts (default: fewer, minutes)")
    paper.add_argument(
        "--output", type=Path, default=Path("report"), metavar="DIR", help="folder to write to (default: %(default)s)"
    )
    paper.add_argument(
        "--check",
        action="store_true",
        help="exit status 1 if the run misses what Tables I and II claim, times among it",
    )
    paper.set_defaults(run=_paper)
    return parser


def _paper(arguments: argparse.Namespace) -> int:
    from stickslip import paper  # matplotlib and rich load here, and only here

    return int(paper.run(output=arguments.output, full=arguments.full, check=arguments.check) or 0)


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    arguments = _parser().parse_args(argv)
    try:
        return arguments.run(arguments)
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)
        return 130
    except OSError as error:  # a folder that cannot be written, and the like
        print(f"stickslip: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
