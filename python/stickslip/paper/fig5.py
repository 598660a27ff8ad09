"""Fig. 5: where the time of a step goes."""

from __future__ import annotations

import numpy as np

from stickslip.paper import figures
from stickslip.paper.methods import METHODS, TASKS, advance, scene_of
from stickslip.paper.page import figure, paragraph
from stickslip.paper.settings import Settings
from stickslip.paper.words import count, listed, number, percent, spread

TITLE = "Fig. 5: cost per stage"
STAGES = {
    "dynamics": ("Dynamics", "#31435c"),
    "detection": ("Detection", "#6b84a3"),
    "delassus": ("Contact rows", "#a9bdd0"),
    "solve": ("Contact solve", "#d98b5f"),
    "integrate": ("Integration", "#cdd1d8"),
}


def work(settings: Settings) -> int:
    """Units of progress."""
    return len(TASKS) * len(METHODS)


def measure(settings: Settings, tick) -> dict:
    """Microseconds per step, stage, task and method."""
    tasks: dict = {}
    for task in TASKS:
        for method in METHODS:
            scene = scene_of(task, method)
            world = scene.world
            world.set_profiling(True)
            rounds = []
            for _ in range(settings.timed_rounds):
                scene.reset(0)
                world.reset_stage_times()
                advance(scene, settings.profiled_steps)
                spent = world.stage_times
                rounds.append({stage: getattr(spent, stage) / max(spent.steps, 1) * 1e6 for stage in STAGES})
            # by the wall clock, so each stage counts where it was disturbed least
            tasks.setdefault(task, {})[method] = {stage: min(r[stage] for r in rounds) for stage in STAGES}
            tick(1)
    return {"steps": settings.profiled_steps, "tasks": tasks}


def draw(data: dict, folder) -> list:
    """Stacked bars."""
    fig, axes = figures.new(1, 4, height=3.7, sharey=True)
    for axis, (task, name) in zip(axes, TASKS.items(), strict=True):
        bottom = np.zeros(len(METHODS))
        for stage, (label, color) in STAGES.items():
            values = np.array([data["tasks"][task][m][stage] for m in METHODS])
            axis.bar(range(len(METHODS)), values, 0.68, bottom=bottom, color=color, label=label)
            bottom += values
        for k, total in enumerate(bottom):
            axis.text(k, total, f"{total:.1f}", ha="center", va="bottom", fontsize=8, color=figures.INK)
        figures.title(axis, name)
        axis.set_xticks(
            range(len(METHODS)),
            [m.short for m in METHODS.values()],
            rotation=55,
            ha="right",
            rotation_mode="anchor",
            fontsize=8,
        )
        axis.margins(y=0.08)
    axes[0].set_ylabel("time per step [µs]")
    figures.legend_above(fig, *axes[0].get_legend_handles_labels())
    return [figures.save(fig, folder / "fig5_stages.png")]


def section(data: dict) -> str:
    """The figure and what it says."""
    tasks = data["tasks"]

    def share(method: str, stage: str) -> list[float]:
        return [tasks[t][method][stage] / sum(tasks[t][method].values()) for t in TASKS]

    delassus = [tasks[t]["bisection"]["delassus"] / max(tasks[t]["bisection"]["solve"], 1e-9) for t in TASKS]
    solves = [tasks[t]["pgs"]["solve"] / max(tasks[t]["bisection"]["solve"], 1e-9) for t in TASKS]
    text = (
        "In the paper the Delassus matrix costs as much as the contact solve. Here it is never formed: the rows "
        f"<i>Y</i> = <i>J L</i><sup>−1</sup> cost {spread(delassus)} times the solve by bisection (which does write the matrix out, within its solve). "
        f"For the solve alone PGS takes {listed([f'{number(v, 2)} times in {TASKS[t].lower()}' for t, v in zip(TASKS, solves, strict=True)])} "
        "the time of bisection. Of our default step, dynamics take "
        f"{percent(min(share('energy_safe', 'dynamics')))} to {percent(max(share('energy_safe', 'dynamics')))}, the solve "
        f"{percent(min(share('energy_safe', 'solve')))} to {percent(max(share('energy_safe', 'solve')))}, and integration most of the rest: it holds the drift with its projection and, at the new configuration, the kinematics and the factor that the next step takes over. "
        "Reading the clock five times per step is part of these numbers."
    )
    return figure(
        "fig5_stages.png", f"<b>Fig. 5.</b> Time per step by stage, over {count(data['steps'])} steps per bar."
    ) + paragraph(text)
