"""The command `stickslip`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

from stickslip import __version__
from stickslip.contact import SOLVE_METHODS, Law
from stickslip.problems import FAMILIES


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
    _add_solve(commands)
    _add_bench(commands)
    return parser


def _add_solve(commands: argparse._SubParsersAction) -> None:
    solve = commands.add_parser(
        "solve",
        help="solve contact problems with one or several methods and compare them",
        description="Solves contact problems of FCLIB files, or generated ones, and prints a table of times and residuals. "
        "Exit status: 0 if everything was read and solved, 1 if something was not solved to the tolerance, 2 for bad input.",
    )
    solve.add_argument("files", nargs="*", metavar="FILE", help="FCLIB file, folder of *.hdf5 files, or quoted pattern")
    solve.add_argument(
        "--method",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME",
        help=f"{', '.join(SOLVE_METHODS)}, or all (default: auto); files come before this option, or behind --",
    )
    solve.add_argument("--law", choices=get_args(Law), default="coulomb", help="friction law (default: %(default)s)")
    solve.add_argument(
        "--tolerance", type=float, default=0.0, metavar="X", help="on the residual [m/s] (default: %(default)s)"
    )
    solve.add_argument(
        "--relative-tolerance",
        type=float,
        default=1e-8,
        metavar="X",
        help="added to it: this much of the largest free velocity max|c| (default: %(default)s)",
    )
    solve.add_argument("--max-sweeps", type=int, metavar="N", help="limit of auto, per_contact and pgs (default: 1000)")
    solve.add_argument(
        "--max-iterations",
        type=int,
        metavar="N",
        help="limit of prox_newton, interior_point and admm (default: the method's own)",
    )
    solve.add_argument("--minimum-norm", action="store_true", help="of impulses with the same velocity take the least")
    solve.add_argument(
        "--plot",
        type=Path,
        metavar="PNG",
        help="picture: residual over time for up to 6 problems, a performance profile for more",
    )
    solve.add_argument("--csv", type=Path, metavar="FILE", help="write the table with all digits")
    solve.add_argument(
        "--family",
        action="append",
        default=[],
        metavar="NAME",
        help="generated problems, may be repeated; with options: box_stack,mass_ratio=1e4. "
        f"Families: {', '.join(FAMILIES)}",
    )
    solve.add_argument(
        "--count", type=int, default=10, metavar="N", help="problems of each family (default: %(default)s)"
    )
    solve.add_argument("--seed", type=int, default=0, metavar="S", help="of a family's first problem (default: 0)")
    solve.set_defaults(run=_solve)


def _add_bench(commands: argparse._SubParsersAction) -> None:
    bench = commands.add_parser(
        "bench",
        help="time batches of robots, beside MuJoCo where it is installed",
        description="Steps many robots in a batch and prints robot-steps per second, the time of each stage, contact residuals and "
        "failures, beside mujoco.rollout on the same task. Exit status: 0 if all went well, 1 if a robot-step was not finite, or "
        "its contacts were not solved and it does not say so, 2 for bad input.",
    )
    bench.add_argument(
        "--task",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME",
        help="stand, trot, hang, drop, random (ANYmal B; default: all of them), or URDF files of other robots",
    )
    bench.add_argument("--base", choices=("floating", "fixed"), default="floating", help="of robots of URDF files")
    bench.add_argument("--envs", type=int, default=1024, metavar="N", help="robots (default: %(default)s)")
    bench.add_argument("--threads", type=int, default=0, metavar="N", help="0: one per core (default)")
    bench.add_argument("--dtype", choices=("float32", "float64"), default="float32", help="(default: %(default)s)")
    bench.add_argument(
        "--integrator", choices=("energy_safe", "semi_implicit"), default="energy_safe", help="(default: %(default)s)"
    )
    bench.add_argument("--steps", type=int, default=2000, metavar="N", help="of each robot (default: %(default)s)")
    bench.add_argument(
        "--instruction-set", choices=("avx2", "avx512", "neon"), help="(default: the widest that the machine has)"
    )
    bench.add_argument("--no-mujoco", dest="mujoco", action="store_false", help="do not run MuJoCo beside it")
    bench.add_argument("--markdown", action="store_true", help="print the tables in Markdown")
    bench.add_argument("--json", type=Path, metavar="FILE", help="write everything, with all digits")
    bench.set_defaults(run=_bench)


def _paper(arguments: argparse.Namespace) -> int:
    from stickslip import paper  # matplotlib and rich load here, and only here

    return int(paper.run(output=arguments.output, full=arguments.full, check=arguments.check) or 0)


def _solve(arguments: argparse.Namespace) -> int:
    from stickslip.compare_solvers.command import solve_command

    return solve_command(arguments)


def _bench(arguments: argparse.Namespace) -> int:
    from stickslip.bench.command import bench_command

    return bench_command(arguments)


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
