"""Infos of many environments as Gymnasium wants them: beside each array "name" a mask "_name" says for whom it holds."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["of_one", "vector_info"]


def vector_info(values: dict[str, Any], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """Copies of arrays (num_envs, ...) and their masks; zero outside of the mask. Dictionaries may be nested."""
    info: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, dict):
            info[name] = vector_info(value, mask)
        else:
            info[name] = np.where(mask, value, np.zeros((), value.dtype))
        info[f"_{name}"] = mask.copy()
    return info


def of_one(infos: dict[str, Any], env: int = 0) -> dict[str, Any]:
    """The info of one environment, without masks."""
    info: dict[str, Any] = {}
    for name, value in infos.items():
        if name.startswith("_") or not infos[f"_{name}"][env]:
            continue
        if isinstance(value, dict):
            info[name] = of_one(value, env)
        else:  # Gymnasium stacks Python's bool, and NumPy's numbers in their own format
            info[name] = bool(value[env]) if value.dtype == np.bool_ else value[env]
    return info
