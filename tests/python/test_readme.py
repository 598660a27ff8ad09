"""What README.md shows runs, and what it links to is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def test_examples_run(capsys):
    world, problem = re.findall(r"```python\n(.*?)```", TEXT, flags=re.S)
    names: dict[str, object] = {}
    exec(compile(world, "README.md", "exec"), names)
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) == 5 and all("FOOT" in line for line in printed[:4])
    assert float(printed[-1].split()[0]) < 1e-8
    exec(compile(problem, "README.md", "exec"), names)
    assert capsys.readouterr().out.startswith("converged ")


@pytest.mark.parametrize("target", re.findall(r"\]\((?!https?:)([^)#]+)", TEXT))
def test_linked_file_is_there(target):
    assert (ROOT / target).is_file()


def test_pictures_are_small():
    for picture in (ROOT / "docs" / "images").iterdir():
        assert picture.stat().st_size < 300_000, picture.name
