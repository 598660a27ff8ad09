"""FCLIB files: frictional contact problems in HDF5, as the field's programs exchange them. See docs/fclib.md.

`load` and `save` speak `ContactProblem`; `read` and `write` speak of what a file holds, with FCLIB's letters. Everything in
Python is in the order x, y, z (normal) per contact; in a file the normal comes first.
"""

from __future__ import annotations

from stickslip._planar import planar_to_spatial, spatial_to_planar
from stickslip.fclib.problems import GlobalProblem, LocalProblem, Solution
from stickslip.fclib.reading import load, read
from stickslip.fclib.writing import save, write

__all__ = [
    "GlobalProblem",
    "LocalProblem",
    "Solution",
    "load",
    "planar_to_spatial",
    "read",
    "save",
    "spatial_to_planar",
    "write",
]
