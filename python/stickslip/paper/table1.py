"""Table I: one sliding contact, solved by four methods."""

from __future__ import annotations

import numpy as np

from stickslip.contact import _time_single_contact
from stickslip.paper import published
from stickslip.paper.methods import TASKS, scene_of
from stickslip.paper.page import html_table, paragraph
from stickslip.paper.settings import Settings
from stickslip.paper.words import count, geometric_mean, listed, number, percent, spread, times

TITLE = "Table I: one contact"
LABELS = {
    "bisection": "Bisection (Algorithm 1, corrected)",
    "golden_section": "Golden section (Preclik)",
    "quartic": "Quartic (analytical)",
    "halley": "Halley (ours)",
}
_TOLERANCE = 1e-6  # [N s]
_SLIPPERY = 0.3  # friction under which the trot slides and still runs [1]


def work(settings: Settings) -> int:
    """Units of progress."""
    return 2 * len(TASKS)


def measure(settings: Settings, tick) -> dict:
    """Times, evaluations and failures per task and method."""
    tasks = {}
    for task in TASKS:
        G, c, mu, found = _sample(task, settings)
        tick(1)
        methods = {}
        if len(mu) > 0:
            timed = _time_single_contact(
                G, c, mu, list(LABELS), "max_dissipation", _TOLERANCE, rounds=settings.single_rounds
            )
            methods = {
                name: {"ns_per_solve": ns, "evaluations": evaluations, "failures": failures}
                for name, (ns, evaluations, failures) in timed.items()
            }
        tasks[task] = {
            "samples": len(mu),
            **found,
            "methods": methods,
        }
        tick(1)
    return {"tolerance": _TOLERANCE, "law": "max_dissipation", "tasks": tasks}


def _sample(task: str, settings: Settings) -> tuple:
    """Sliding contacts; where a task has too few, the rest comes from a slippery floor."""
    *solved, steps, seen = _slipping(scene_of(task, "bisection"), settings.slip_samples, settings.slip_max_steps)
    found = {"on_the_floor": len(solved[2]), "steps": steps, "slip_share": len(solved[2]) / max(seen, 1)}
    missing = settings.slip_samples - len(solved[2])
    if missing > 0:
        scene = scene_of(task, "bisection")
        scene.world.set_material_pair("default", "default", friction=_SLIPPERY)
        *more, _, _ = _slipping(scene, missing, settings.slip_max_steps)
        solved = [np.concatenate(pair) for pair in zip(solved, more, strict=True)]
    return (*solved, found)


def _slipping(scene, wanted: int, max_steps: int) -> tuple:
    return scene._task.sample_slipping(scene.world._core, scene.robot._core, wanted, max_steps)


def draw(data: dict, folder) -> list:
    """No figure."""
    return []


def section(data: dict) -> str:
    """The table and what it says."""
    tasks = {t: d for t, d in data["tasks"].items() if d["methods"]}
    head = ["Time per solve, ns", *(TASKS[t] for t in tasks), "Mean", "Paper", "Paper / ours"]
    rows = []
    mean = {m: geometric_mean([d["methods"][m]["ns_per_solve"] for d in tasks.values()]) for m in LABELS}
    for m, label in LABELS.items():
        theirs = published.SINGLE_CONTACT.get(m)
        rows.append(
            [label]
            + [number(d["methods"][m]["ns_per_solve"]) for d in tasks.values()]
            + [number(mean[m])]
            + ([number(theirs * 1e9), number(theirs * 1e9 / mean[m], 2)] if theirs else ["", ""])
        )
    detail = [
        [label]
        + [number(d["methods"][m]["evaluations"], 3) for d in tasks.values()]
        + [percent(d["methods"][m]["failures"]) for d in tasks.values()]
        for m, label in LABELS.items()
    ]
    names = [TASKS[t] for t in tasks]
    detail_head = ["", *(f"{n}" for n in names), *(f"{n}" for n in names)]
    groups = [("", 1), ("Evaluations per solve", len(names)), ("Failures", len(names))]
    return (
        html_table(head, rows, strong_rows=(len(rows) - 1,))
        + html_table(detail_head, detail, groups=groups, strong_rows=(len(rows) - 1,))
        + "".join(paragraph(p) for p in _sentences(tasks, mean))
    )


def _sentences(tasks: dict, mean: dict) -> list[str]:
    sample = listed([f"{count(d['samples'])} in {TASKS[t].lower()}" for t, d in tasks.items()])
    ratio = {
        m: [d["methods"][m]["ns_per_solve"] / d["methods"]["bisection"]["ns_per_solve"] for d in tasks.values()]
        for m in LABELS
    }
    theirs = {m: published.SINGLE_CONTACT[m] / published.SINGLE_CONTACT["bisection"] for m in published.SINGLE_CONTACT}
    golden, quartic = geometric_mean(ratio["golden_section"]), geometric_mean(ratio["quartic"])
    halley = [1 / r for r in ratio["halley"]]
    slowest = max(d["methods"]["halley"]["ns_per_solve"] for d in tasks.values())
    order_ours = sorted(theirs, key=lambda m: mean[m])
    order_theirs = sorted(theirs, key=lambda m: theirs[m])
    out = [
        f"Sliding contacts only, taken from the steps of the four tasks ({sample}; the other contacts' impulses held at the "
        f"solution), with the law of the paper (eq. 8), stopped when the impulse is known to 10<sup>−6</sup> N s. Medians of "
        "interleaved runs on one core. A failure is a solve that the method gives up, or whose result misses the law by more "
        "than ten times what the tolerance allows."
    ]
    topped = [
        f"{TASKS[t].lower()} ({count(d['on_the_floor'])} in {count(d['steps'])} steps)"
        for t, d in tasks.items()
        if d["on_the_floor"] < d["samples"]
    ]
    if topped:
        out.append(
            f"Too few feet slide in {listed(topped)}: the rest was taken on a floor with friction {_SLIPPERY} in place of 0.8."
        )
    out.append(
        f"Bisection is {times(max(golden, 1 / golden))} as {'fast' if golden > 1 else 'slow'} as golden section, {spread(ratio['golden_section'])} over the tasks (paper: "
        f"{number(theirs['golden_section'], 2)} times as fast) and the quartic takes {times(quartic)} as long as bisection "
        f"(paper: {number(theirs['quartic'], 2)}); the order of the paper's three methods is "
        + (
            "the paper's."
            if order_ours == order_theirs
            else f"{listed([LABELS[m].split(' (')[0].lower() for m in order_ours])} here."
        )
        + (
            " Our quartic is Ferrari's closed form with Newton polish on five precomputed coefficients; the paper used a general solver, with the "
            "coefficients and checks as costly as the solver."
            if quartic < 1
            else ""
        )
    )
    fails = [
        f"{LABELS[m].split(' (')[0].lower()} {percent(max(d['methods'][m]['failures'] for d in tasks.values()))}"
        for m in LABELS
        if any(d["methods"][m]["failures"] > 0 for d in tasks.values())
    ]
    clean = [LABELS[m].split(" (")[0] for m in LABELS if all(d["methods"][m]["failures"] == 0 for d in tasks.values())]
    out.append(
        f"Halley's method, our default, is {spread(halley)} times faster than bisection, at most {number(slowest, 2)} ns per "
        "contact: a bracket in closed form and no trigonometry. "
        + (
            "No method failed"
            if len(clean) == len(LABELS)
            else f"{listed(clean)} never failed"
            if clean
            else "No method was free of failures"
        )
        + (f"; at worst over the tasks: {listed(fails)}." if fails else ".")
    )
    speedup = published.SINGLE_CONTACT["bisection"] * 1e9 / mean["bisection"]
    faster = (
        f"Our bisection needs {number(mean['bisection'], 2)} ns where the paper's took {number(published.SINGLE_CONTACT['bisection'] * 1e9, 2)} "
        f"({times(speedup)} the speed)."
        if speedup >= 1
        else f"Our bisection needs {number(mean['bisection'], 2)} ns, {times(1 / speedup)} what the paper's took."
    )
    out.append(
        f"What differs: the processor (the paper's is an {published.PROCESSOR}). Algorithm 1 as printed cannot run: the "
        "line-of-sight test in its line 13 has the wrong sign, and as printed it turns back every point it should accept; "
        "ours has the sign corrected, restores what a rejected step changed, and ends every loop. The paper saw its bisection converge in two steps in most cases; it does not print "
        f"its step sizes β, and ours takes {spread([d['methods']['bisection']['evaluations'] for d in tasks.values()])} evaluations to halve down to the tolerance. "
        "The samples differ too: the paper does not say that its samples slide, and our ANYmal is model B, not the first one. "
        + faster
    )
    return out
