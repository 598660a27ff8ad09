"""What README.md and pages of docs/ show runs, and what README.md links to is there."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def python_blocks(text: str) -> list[str]:
    return re.findall(r"```python\n(.*?)```", text, flags=re.S)


def test_examples_run(capsys):
    world, batch, problem = python_blocks(TEXT)
    names: dict[str, object] = {}
    exec(compile(world, "README.md", "exec"), names)
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) == 5 and all("FOOT" in line for line in printed[:4])
    assert float(printed[-1].split()[0]) < 1e-8
    exec(compile(batch, "README.md", "exec"), names)
    lowest, flagged = capsys.readouterr().out.split(maxsplit=1)
    assert 0.4 < float(lowest) < 0.6 and flagged == "[]\n"
    assert names["envs"].num_envs == 1024
    exec(compile(problem, "README.md", "exec"), names)
    assert capsys.readouterr().out.startswith("converged ")


def test_page_on_batches_runs(capsys):
    # One block after the other, as one reads; what needs a library that is not installed is left out.
    blocks = python_blocks((ROOT / "docs" / "batch.md").read_text(encoding="utf-8"))
    names: dict[str, object] = {}
    ran = 0
    for block in blocks:
        needed = re.findall(r"^import (\w+)", block, flags=re.M)
        if all(map(find_spec, needed)):
            exec(compile(block, "docs/batch.md", "exec"), names)
            ran += 1
    assert ran >= len(blocks) - 2
    printed = capsys.readouterr().out.splitlines()
    assert float(printed[0].split()[2]) < 1e-5, "residual of the first block"
    batch = names["batch"]
    assert repr(batch) == printed[1] and batch.memory_bytes > 256 * 956


@pytest.mark.parametrize("target", re.findall(r"\]\((?!https?:)([^)#]+)", TEXT))
def test_linked_file_is_there(target):
    assert (ROOT / target).is_file()


def test_pictures_are_small():
    for picture in (ROOT / "docs" / "images").iterdir():
        assert picture.stat().st_size < 300_000, picture.name
