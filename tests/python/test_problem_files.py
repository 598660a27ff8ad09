"""Every FCLIB file of a folder of one's own is solved: `STICKSLIP_PROBLEM_FILES=folder python -m pytest tests/python/test_problem_files.py`."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import pytest

import oracles
import stickslip as ss

FOLDER = os.environ.get("STICKSLIP_PROBLEM_FILES", "")
FILES = sorted(path for path in Path(FOLDER).rglob("*") if path.suffix in (".hdf5", ".h5")) if FOLDER else []
LARGE = 110  # contacts


@pytest.mark.skipif(not FOLDER, reason="STICKSLIP_PROBLEM_FILES names no folder with FCLIB files")
def test_the_folder_has_problem_files():
    assert FILES, f"STICKSLIP_PROBLEM_FILES is {FOLDER}, a folder without a .hdf5 or .h5 file"


@pytest.mark.skipif(not FOLDER, reason="STICKSLIP_PROBLEM_FILES names no folder with FCLIB files")
@pytest.mark.parametrize("path", FILES, ids=[str(path.relative_to(FOLDER)) for path in FILES])
def test_the_file_is_solved(path):
    """To 1e-8 of max|c|, large ones to 1e-6; the residual is the one of the oracle."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a W in few digits, a solution that was never written
        p = ss.ContactProblem.load(path)
    relative = 1e-8 if p.num_contacts <= LARGE else 1e-6
    limit = relative * np.abs(p.free_velocity).max(initial=0)
    s = ss.solve(p, tolerance=0, relative_tolerance=relative)
    assert s.converged, f"{p}: {s.status} at {s.residual:.3g} m/s, {limit:.3g} allowed"
    args = (p.dense_delassus(), p.free_velocity, p.friction, s.impulse)
    exact, rounding = oracles.natural_map(*args), oracles.natural_map_rounding(*args)
    assert (exact <= limit * (1 + 1e-6) + rounding).all()
