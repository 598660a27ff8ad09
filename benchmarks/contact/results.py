"""What the raw times and residuals of stickslip_contact_compare come to: tables, aims, a performance profile."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

LEVELS = (1e-6, 1e-8)  # residual over max|c| at which a problem counts as solved
OURS = "stickslip auto"
ADMM = "pinocchio admm"
# Of a solver's settings within this share of its best solved share, the fastest one counts.
NEARLY_BEST = 0.002


@dataclass
class Method:
    solver: str
    setting: str
    microseconds: np.ndarray  # per problem
    residual: np.ndarray  # per problem, over max|c|

    def solved(self, level: float) -> np.ndarray:
        return self.residual <= level

    def share(self, level: float) -> float:
        return float(self.solved(level).mean())


@dataclass
class ProblemSet:
    name: str
    group: str
    contacts: float  # mean
    methods: list[Method]

    def __len__(self) -> int:
        return len(self.methods[0].residual)

    def solvers(self) -> list[str]:
        return list(dict.fromkeys(m.solver for m in self.methods))

    def settings(self, solver: str) -> list[Method]:
        return [m for m in self.methods if m.solver == solver]

    def chosen(self, solver: str, level: float) -> Method:
        """The setting that counts for a solver: the fastest in the mean of those that solve the most, nearly."""
        settings = self.settings(solver)
        best = max(m.share(level) for m in settings)
        return min((m for m in settings if m.share(level) >= best - NEARLY_BEST), key=lambda m: m.microseconds.mean())

    def fastest(self, solver: str, level: float) -> Method:
        """As if a solver knew its best setting for each problem: the least time of those that solve it."""
        settings = self.settings(solver)
        times = np.array([np.where(m.solved(level), m.microseconds, np.inf) for m in settings])
        residuals = np.array([m.residual for m in settings])
        best = times.argmin(axis=0)
        columns = np.arange(len(self))
        solved = np.isfinite(times[best, columns])
        return Method(
            solver,
            "best of each problem",
            np.where(solved, times[best, columns], np.inf),
            np.where(solved, residuals[best, columns], residuals.min(axis=0)),
        )


def read(data: dict) -> list[ProblemSet]:
    """The sets of the program's JSON."""
    return [
        ProblemSet(
            s["name"],
            s["group"],
            s["contacts"],
            [
                Method(m["solver"], m["setting"], np.array(m["microseconds"]), np.array(m["residual"]))
                for m in s["methods"]
            ],
        )
        for s in data["sets"]
    ]


def groups(sets: list[ProblemSet]) -> list[ProblemSet]:
    """Sets of one group joined to one."""
    joined = []
    for name in dict.fromkeys(s.group for s in sets):
        members = [s for s in sets if s.group == name]
        total = sum(len(s) for s in members)
        methods = [
            Method(
                same[0].solver,
                same[0].setting,
                np.concatenate([m.microseconds for m in same]),
                np.concatenate([m.residual for m in same]),
            )
            for same in zip(*(s.methods for s in members), strict=True)
        ]
        joined.append(ProblemSet(name, name, sum(s.contacts * len(s) for s in members) / total, methods))
    return joined


def times_faster(ours: Method, other: Method, level: float) -> float:
    """Mean time of the other over ours, on the problems that both solve to the level; NaN where there are none."""
    both = ours.solved(level) & other.solved(level)
    return float(other.microseconds[both].sum() / ours.microseconds[both].sum()) if both.any() else float("nan")


def row(problems: ProblemSet, method: Method, level: float) -> list[str]:
    times = method.microseconds
    return [
        method.solver,
        method.setting,
        *(f"{100 * method.share(at):.2f}" for at in LEVELS),
        f"{times.mean():.2f}",
        *(f"{np.quantile(times, q):.2f}" for q in (0.5, 0.99)),
        f"{np.median(method.residual):.0e}",
        f"{times_faster(problems.chosen(OURS, level), method, level):.1f}" if problems.settings(OURS) else "",
    ]


HEADER = ["solver", "setting", "% <= 1e-6", "% <= 1e-8", "mean us", "p50 us", "p99 us", "residual", "time / ours"]


def table(lines: list[list[str]]) -> str:
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [HEADER, ["---"] * len(HEADER), *lines]) + "\n"


def markdown(sets: list[ProblemSet]) -> str:
    """Per set and level one row per solver in the setting that counts; at the end every setting."""
    text = []
    for problems in sets:
        for level in LEVELS:
            text.append(
                f"## {problems.name} to {level:.0e}: {len(problems)} problems, {problems.contacts:.1f} contacts\n"
            )
            text.append(table([row(problems, problems.chosen(s, level), level) for s in problems.solvers()]))
    text.append("# Every setting\n")
    for problems in sets:
        text.append(f"## {problems.name}, time / ours at 1e-08\n")
        text.append(table([row(problems, m, 1e-8) for m in problems.methods]))
    return "\n".join(text)


@dataclass
class Aim:
    text: str
    met: bool


def at_most(text: str, value: float, limit: float, unit: str) -> Aim:
    return Aim(f"{text}: {value:.2f} {unit} (aim: at most {limit:g})", value <= limit)


def aims(sets: list[ProblemSet]) -> list[Aim]:
    """What the comparison must show; aims of groups that were not run are left out."""
    found = []
    for problems in groups(sets):
        if problems.name not in ("4 feet", "8 contacts"):
            continue
        ours = problems.chosen(OURS, 1e-8)
        times = ours.microseconds
        if problems.name == "4 feet":
            found.append(at_most("4 feet, cold, mean", times.mean(), 2, "us"))
        else:
            found.append(at_most("8 contacts, cold, p50", np.quantile(times, 0.5), 15, "us"))
            found.append(at_most("8 contacts, cold, p99", np.quantile(times, 0.99), 100, "us"))
        for level in LEVELS if ADMM in problems.solvers() else ():
            ours, admm = problems.chosen(OURS, level), problems.fastest(ADMM, level)
            one = times_faster(ours, problems.chosen(ADMM, level), level)
            ratio = times_faster(ours, admm, level)
            head = f"{problems.name} to {level:.0e}"
            found.append(
                Aim(
                    f"{head}: {one:.1f} times faster than ADMM in its best setting, {ratio:.1f} times if it had the best "
                    "setting for each problem (aim: at least 5)",
                    ratio >= 5,
                )
            )
            share = ours.share(level)
            best = max(m.share(level) for m in problems.settings(ADMM))
            found.append(
                Aim(
                    f"{head}: {100 * share:.2f} % solved, ADMM {100 * best:.2f} % (aim: more, or 100 %)",
                    share > best or share == 1,
                )
            )
    return found


def plot(sets: list[ProblemSet], path: Path, level: float = 1e-8) -> None:
    """Performance profile: share of problems solved to the level within a time, per group and solver."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    joined = groups(sets)
    styles = line_styles(list(dict.fromkeys(s for problems in joined for s in problems.solvers())))
    width = max(9.0, 4.2 * len(joined))
    figure, axes = plt.subplots(1, len(joined), figsize=(width, 4), sharey=True, squeeze=False)
    for axis, problems in zip(axes[0], joined, strict=True):
        for solver in problems.solvers():
            method = problems.chosen(solver, level)
            times = np.sort(method.microseconds[method.solved(level)])
            if len(times):
                shares = 100 * np.arange(1, len(times) + 1) / len(problems)
                ends = [*times, max(times[-1], 1e6)]
                axis.step(ends, [*shares, shares[-1]], where="post", **styles[solver])
        axis.set(xscale="log", xlim=(0.3, 1e5), ylim=(0, 102), title=problems.name, xlabel="time per problem [us]")
        axis.grid(alpha=0.3)
    axes[0][0].set_ylabel(f"solved to {level:.0e} max|c| [%]")
    handles = [plt.Line2D([], [], label=solver, **style) for solver, style in styles.items()]
    figure.legend(handles=handles, loc="lower center", ncols=4, frameon=False, fontsize=9)
    figure.tight_layout(rect=(0, 0.2, 1, 1))
    figure.savefig(path, dpi=120)
    plt.close(figure)


def line_styles(solvers: list[str]) -> dict[str, dict]:
    """One line style per maker, one color per solver of a maker; ours is the thick one."""
    strokes = {"stickslip": "-", "pinocchio": "--", "siconos": ":"}
    seen = dict.fromkeys(strokes, 0)
    styles = {}
    for solver in solvers:
        maker = solver.split()[0]
        styles[solver] = {
            "color": f"C{seen[maker]}",
            "linestyle": strokes[maker],
            "linewidth": 3 if solver == OURS else 1.5,
        }
        seen[maker] += 1
    return styles
