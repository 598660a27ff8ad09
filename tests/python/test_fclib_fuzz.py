"""A few hundred of the damaged files that tests/fuzz/fuzz_fclib.py makes without end."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from stickslip import fclib

SCRIPT = Path(__file__).parents[1] / "fuzz" / "fuzz_fclib.py"


@pytest.fixture(scope="module")
def fuzz() -> ModuleType:
    spec = importlib.util.spec_from_file_location("fuzz_fclib", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("first", range(0, 120, 40))
def test_changed_groups_and_data_sets_are_read_or_refused_by_name(fuzz: ModuleType, tmp_path: Path, first: int) -> None:
    problems = sum(fuzz.run_case(tmp_path, seed, "structure") for seed in range(first, first + 40))
    assert 0 < problems < 30, "changes that all or none survive test little"


def test_changed_bytes_are_read_or_refused_by_name(tmp_path: Path) -> None:
    """In a process of its own, which the HDF5 library may take down."""
    command = [sys.executable, SCRIPT, "--kind", "bytes", "--count", "80", "--folder", tmp_path]
    run = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, (
        f"exit {run.returncode}; left {[p.name for p in tmp_path.iterdir()]}\n{run.stderr[-3000:]}"
    )
    assert "80 cases" in run.stdout and list(tmp_path.iterdir()) == []


def test_a_case_is_made_again_by_its_seed(fuzz: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    contents = []
    monkeypatch.setattr(fuzz, "check", lambda path: contents.append(path.read_bytes()) or True)
    for _ in range(2):
        fuzz.run_case(tmp_path, 5, "bytes")
    assert contents[0] == contents[1]


def test_the_target_notices_what_may_not_happen(
    fuzz: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.hdf5"
    path.write_bytes(fuzz.seed_files()[0])
    assert fuzz.check(path) is True
    for wrong, says in [
        (KeyError("W"), "W"),
        (ValueError("W is wrong"), "does not say so"),
        (UnicodeError(f"{path}: no"), "a UnicodeError"),
    ]:

        def read(_: Path, error: Exception = wrong) -> None:
            raise error

        monkeypatch.setattr(fclib, "read", read)
        with pytest.raises((AssertionError, KeyError), match=says):
            fuzz.check(path)
    monkeypatch.setattr(fclib, "read", lambda _: np.zeros(fuzz.LARGEST_PEAK // 8 + 1))
    with pytest.raises(AssertionError, match="bytes of memory"):
        fuzz.check(path)
