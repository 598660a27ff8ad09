"""A strip of pictures of each task."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from stickslip.paper.methods import TASKS, advance, scene_of
from stickslip.paper.page import paragraph
from stickslip.paper.render import render
from stickslip.paper.robot_view import Shot
from stickslip.paper.settings import Settings

TITLE = "The four tasks"
#: When the pictures are taken [s], spread evenly over as many frames as wanted.
_TIMES = {
    "trot": (4.00, 4.08, 4.16, 4.24, 4.32, 4.40),
    "hang": (0.00, 0.35, 0.65, 1.00, 1.60, 3.00),
    "drop": (0.00, 0.25, 0.42, 0.52, 0.70, 1.20),
    "random": (0.30, 0.55, 0.85, 1.10, 1.70, 2.30),
}
_VIEWS = {
    "trot": {"distance": 2.55, "look_up": 0.36},
    "hang": {"distance": 4.2, "look_up": 0.30, "elevation": 6, "floor_opacity": 0.32},
    "drop": {"distance": 3.15, "look_up": 0.52},
    "random": {"distance": 2.9, "look_up": 0.42},
}
_CAPTIONS = {
    "trot": "<b>Trot</b> at 1.5 m/s, by a controller that places the feet and distributes the stance forces.",
    "hang": "<b>Hang</b>: thrown from 1 m, no motors; only the feet meet the ground, so the torso hangs through it.",
    "drop": "<b>Drop</b>: thrown with 1 m/s, no motors; feet and torso meet the ground.",
    "random": "<b>Random</b>: a PD controller follows random targets.",
}


def work(settings: Settings) -> int:
    """Units of progress."""
    return len(TASKS) * settings.frames


def measure(settings: Settings, tick) -> dict:
    """The moments that are shown; the pictures are drawn with them at hand."""
    return {
        "tasks": {
            task: [
                float(t) for t in np.asarray(times)[np.linspace(0, len(times) - 1, settings.frames).round().astype(int)]
            ]
            for task, times in _TIMES.items()
        },
        "size": list(settings.frame_size),
    }


def draw(data: dict, folder: Path, tick=lambda n: None) -> list:
    """Frames and strips."""
    files = []
    with ThreadPoolExecutor(2) as pool:
        for task in TASKS:
            shots = _shots(task, data["tasks"][task])

            def picture(shot, tick=tick):
                image = Image.fromarray(
                    render(shot.parts, shot.camera, *data["size"], floor_opacity=shot.floor_opacity)
                )
                tick(1)
                return image

            frames = list(pool.map(picture, shots))
            for k, frame in enumerate(frames):
                frame.save(folder / f"frame_{task}_{k}.jpg", quality=90)
            files.append(folder / f"strip_{task}.png")
            strip(frames, [f"{t:.2f} s" for t in data["tasks"][task]]).save(files[-1], optimize=True)
    return files


def _shots(task: str, times: list[float]) -> list[Shot]:
    """The task's default step, looked at at these times."""
    scene, shots, done = scene_of(task, "energy_safe"), [], 0
    for t in times:
        steps = round(t / scene.world.time_step)
        advance(scene, steps - done)
        done = steps
        shots.append(Shot.of(scene, **_VIEWS[task]))
    return shots


def strip(frames: list[Image.Image], labels: list[str] | None = None, gap: int = 6) -> Image.Image:
    """Pictures side by side, on white, with a label under each."""
    width, height = frames[0].size
    size = max(height // 18, 9)
    foot = int(1.9 * size) if labels else 0
    out = Image.new("RGB", (len(frames) * width + (len(frames) - 1) * gap, height + foot), "white")
    for k, frame in enumerate(frames):
        left = k * (width + gap)
        out.paste(frame, (left, 0))
        if labels:
            ImageDraw.Draw(out).text(
                (left + width / 2, height + foot / 2), labels[k], (91, 100, 114), _font(size), anchor="mm"
            )
    return out


def _font(size: int):
    import matplotlib

    return ImageFont.truetype(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), size)


def section(data: dict) -> str:
    """The frames, three or six in a row."""
    out = paragraph(
        "ANYmal B, 30.5 kg, 18 degrees of freedom; the torso's box and four foot spheres collide. Default step, 1 ms. Arrows are "
        "contact forces: one of 0.6 m carries the robot's weight."
    )
    for task, times in data["tasks"].items():
        frames = "".join(
            f'<div><img src="frame_{task}_{k}.jpg" alt="{TASKS[task]} at {t:.2f} s"><span>{t:.2f} s</span></div>'
            for k, t in enumerate(times)
        )
        out += (
            f"<figure class=strip><div class=frames>{frames}</div><figcaption>{_CAPTIONS[task]}</figcaption></figure>\n"
        )
    return out
