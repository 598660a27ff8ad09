"""Fig. 6: how far the law of maximum dissipation (eq. 8) is from Coulomb's (eq. 6) on the same contact problems."""

from __future__ import annotations

import numpy as np

import stickslip as ss
from stickslip.paper import figures, published
from stickslip.paper.methods import TASKS, scene_of
from stickslip.paper.page import figure, html_table, paragraph
from stickslip.paper.settings import Settings
from stickslip.paper.words import count, number, percent

TITLE = "Fig. 6: two friction laws"
COLORS = {"trot": "#3566a8", "hang": "#c8553d", "drop": "#d9a13b", "random": "#1f8a70"}
_TOLERANCE = 1e-10  # [m/s]
_EDGES = np.arange(-10, 1.01, 0.5)  # log10 of the difference
_SLIDES = 1e-6  # [m/s]
_LOOSE = 1e-9  # smallest over largest eigenvalue of G below which impulses are not unique


def work(settings: Settings) -> int:
    """Units of progress."""
    return len(TASKS) * 10


def measure(settings: Settings, tick) -> dict:
    """Relative differences per contact, of all contacts and of those that slide."""
    tasks = {}
    for task in TASKS:
        scene = scene_of(task, "bisection")
        problems = scene._task.sample_problems(
            scene.world._core, scene.robot._core, settings.law_steps, settings.law_stride
        )
        tick(2)
        differences, sliding, loose, unsolved = [], [], 0, 0
        for k, (G, c, mu, start) in enumerate(problems):
            if k % max(len(problems) // 8, 1) == 0:
                tick(1)
            eigenvalues = np.linalg.eigvalsh(G)
            if eigenvalues[0] < _LOOSE * eigenvalues[-1]:
                loose += 1
                continue
            problem = ss.ContactProblem(G, c, mu)
            dissipating = ss.solve(
                problem,
                method="per_contact",
                law="max_dissipation",
                tolerance=_TOLERANCE,
                max_sweeps=2000,
                impulse=start,
            )
            coulomb = ss.solve(problem, law="coulomb", tolerance=_TOLERANCE, impulse=start)
            if not (dissipating.converged and coulomb.converged):
                unsolved += 1
                continue
            d, s = _compare(dissipating.impulse, coulomb.impulse, coulomb.velocity)
            differences.append(d)
            sliding.append(s)
        d = np.concatenate(differences) if differences else np.empty(0)
        s = np.concatenate(sliding) if sliding else np.empty(0, dtype=bool)
        tasks[task] = {
            "problems": len(problems),
            "not_unique": loose,
            "not_converged": unsolved,
            "all": _figures(d),
            "sliding": _figures(d[s]),
        }
    return {"tolerance": _TOLERANCE, "edges_log10": _EDGES.tolist(), "tasks": tasks}


def _compare(dissipating, coulomb, velocity) -> tuple[np.ndarray, np.ndarray]:
    """|lambda_b - lambda_p| / |lambda_p| of the contacts that push, and which of them slide."""
    b, p, v = dissipating.reshape(-1, 3), coulomb.reshape(-1, 3), velocity.reshape(-1, 3)
    size_b, size_p = np.linalg.norm(b, axis=1), np.linalg.norm(p, axis=1)
    push = np.maximum(size_b, size_p) > 1e-12
    with np.errstate(divide="ignore"):
        difference = np.linalg.norm(b - p, axis=1)[push] / size_p[push]
    slides = (np.linalg.norm(v[:, :2], axis=1) > _SLIDES)[push]
    return np.maximum(difference, 1e-16), slides


def _figures(d: np.ndarray) -> dict:
    if len(d) == 0:
        return {
            "contacts": 0,
            "below_1_percent": 0.0,
            "median": 0.0,
            "p90": 0.0,
            "histogram_percent": [0.0] * (len(_EDGES) - 1),
        }
    clipped = np.clip(np.log10(np.minimum(d, 1e16)), _EDGES[0], _EDGES[-1] - 1e-9)
    return {
        "contacts": len(d),
        "below_1_percent": float((d < 0.01).mean()),
        "median": float(np.median(d)),
        "p90": float(min(np.percentile(d, 90), 1e16)),
        "histogram_percent": (100 * np.histogram(clipped, _EDGES)[0] / len(d)).tolist(),
    }


def draw(data: dict, folder) -> list:
    """Two panels."""
    fig, axes = figures.new(1, 2, height=3.6, sharey=True, sharex=True)
    edges = np.array(data["edges_log10"])
    for axis, (kind, title) in zip(axes, {"all": "All contacts", "sliding": "Sliding contacts"}.items(), strict=True):
        axis.axvspan(-2, edges[-1], color="#f3f4f6", lw=0)
        for task, name in TASKS.items():
            axis.stairs(data["tasks"][task][kind]["histogram_percent"], edges, color=COLORS[task], label=name, lw=1.8)
        figures.title(axis, title)
        axis.set_xlabel("|λ$_b$ − λ$_p$| / |λ$_p$|")
        marks = [-10, -8, -6, -4, -2, 0]
        axis.set_xticks(marks, ["≤10⁻¹⁰", "10⁻⁸", "10⁻⁶", "10⁻⁴", "1 %", "1"])
        axis.set_xlim(edges[0], edges[-1])
    axes[0].set_ylabel("contacts [%]")
    axes[1].text(-1.9, axes[1].get_ylim()[1] * 0.97, "above 1 %", fontsize=8, color=figures.MUTED, va="top")
    figures.legend_above(fig, *axes[0].get_legend_handles_labels())
    return [figures.save(fig, folder / "fig6_laws.png")]


def section(data: dict) -> str:
    """Figure, table and what they say."""
    tasks = data["tasks"]
    head = ["", "All contacts", "below 1 %", "median", "Sliding", "below 1 %", "median", "p90"]
    rows = []
    for t, name in TASKS.items():
        a, s = tasks[t]["all"], tasks[t]["sliding"]
        rows.append(
            [name, count(a["contacts"]), percent(a["below_1_percent"]), _difference(a["median"])]
            + (
                [count(s["contacts"]), percent(s["below_1_percent"]), _difference(s["median"]), _difference(s["p90"])]
                if s["contacts"]
                else ["0", "–", "–", "–"]
            )
        )
    return (
        figure(
            "fig6_laws.png",
            "<b>Fig. 6.</b> Difference of the contact impulses under maximum dissipation (eq. 8, λ<sub>b</sub>) and Coulomb's law "
            "(eq. 6, λ<sub>p</sub>), on the same problems.",
        )
        + html_table(head, rows)
        + "".join(paragraph(p) for p in _sentences(tasks))
    )


def _difference(value: float) -> str:
    return (
        "&lt; 10<sup>−8</sup>"
        if value < 1e-8
        else number(value, 2)
        if value < 1e-3
        else percent(value)
        if value < 10
        else "&gt; 10"
    )


def _pooled(tasks: dict, kind: str) -> tuple[int, float]:
    count = sum(d[kind]["contacts"] for d in tasks.values())
    return count, sum(d[kind]["contacts"] * d[kind]["below_1_percent"] for d in tasks.values()) / max(count, 1)


def _sentences(tasks: dict) -> list[str]:
    total, below = _pooled(tasks, "all")
    slides, slides_below = _pooled(tasks, "sliding")
    problems = sum(d["problems"] for d in tasks.values())
    loose = sum(d["not_unique"] for d in tasks.values())
    unsolved = sum(d["not_converged"] for d in tasks.values())
    many = [d["sliding"]["median"] for d in tasks.values() if d["sliding"]["contacts"] >= 100]
    medians = many or [d["sliding"]["median"] for d in tasks.values() if d["sliding"]["contacts"]]
    out = [
        f"The paper: more than {percent(published.LAWS_BELOW_1_PERCENT)} below 1 %. Here: {percent(below)} of all contacts"
        + (
            f", but {percent(slides_below)} of the {count(slides)} that slide, whose impulses differ by {percent(min(medians))} to "
            f"{percent(max(medians))} (medians of the tasks that slide)."
            if slides
            else "; none of them slides."
        )
    ]
    if slides and slides_below < below:
        out.append(
            f"A contact that sticks solves both laws with the same impulse, and {percent(1 - slides / max(total, 1))} of ours stick: the agreement over all "
            "contacts measures how rarely a task slides. Where a foot slides, the laws disagree about the direction of friction, because normal and "
            "tangential motion of a robot's foot are coupled (G<sub>xz</sub>, G<sub>yz</sub> are not small). That is why our default is Coulomb's law; "
            '<code>law="max_dissipation"</code> is the paper\'s model.'
        )
    out.append(
        f"Of {count(problems)} problems, {count(loose)} were left out because their impulses are not unique (a torso on several "
        f"corners) and {count(unsolved)} because a solve did not reach 10<sup>−10</sup> m/s. The paper ran PGS to 10<sup>−20</sup>, which doubles "
        "cannot resolve; our λ<sub>p</sub> comes from our own solver, certified by its residual."
    )
    return out
