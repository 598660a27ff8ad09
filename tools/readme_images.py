"""Draws the pictures of README.md into docs/images: `python tools/readme_images.py [REPORT]`.

The plot takes its numbers from REPORT/results.json, written by `make run` (default: report).
"""

from __future__ import annotations

import dataclasses
import json
import sys
import tempfile
from pathlib import Path

from PIL import Image

from stickslip.paper import fifty_hertz, settings, strips

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
FRAMES = (("trot", 1), ("trot", 3), ("drop", 1), ("drop", 3), ("random", 3), ("hang", 5))


def main() -> None:
    results = json.loads((Path(sys.argv[1] if len(sys.argv) > 1 else "report") / "results.json").read_text())
    IMAGES.mkdir(parents=True, exist_ok=True)
    s = dataclasses.replace(settings.quick(), frame_size=(270, 224))
    with tempfile.TemporaryDirectory() as folder:
        strips.draw(strips.measure(s, lambda n: None), Path(folder))
        frames = [Image.open(Path(folder) / f"frame_{task}_{k}.jpg") for task, k in FRAMES]
        strips.strip(frames).save(IMAGES / "tasks.png", optimize=True)
        fifty_hertz.draw(results["fifty_hertz"], Path(folder))
        Image.open(Path(folder) / "fifty_hertz.png").convert("RGB").quantize(64).save(
            IMAGES / "large_steps.png", optimize=True
        )


if __name__ == "__main__":
    main()
