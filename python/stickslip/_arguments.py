"""Checks of arguments, so that every error names the argument, says what came and what is wanted."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def _float(value: Any) -> float:
    if isinstance(value, (str, bytes)):  # which float() would read
        raise TypeError
    return float(value)


def number(name: str, value: Any) -> float:
    """A finite float."""
    try:
        result = _float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} is {value!r}; a number is wanted") from None
    if not np.isfinite(result):
        raise ValueError(f"{name} is {result}; it must be finite")
    return result


def limit(name: str, value: Any) -> float:
    """A positive float; it may be infinite."""
    try:
        result = _float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} is {value!r}; a number is wanted") from None
    if not result > 0:
        raise ValueError(f"{name} is {result}; it must be positive")
    return result


def interval(name: str, value: Any) -> tuple[float, float]:
    """Bounds (low, high), low <= high; they may be infinite."""
    try:
        low, high = map(_float, value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} is {value!r}; a pair of numbers (low, high) is wanted") from None
    if not low <= high:
        raise ValueError(f"{name} is {(low, high)}; low must not exceed high")
    return low, high


LARGEST_COUNT = 2**31 - 1  # the core counts in 32 bits


def count(name: str, value: Any, least: int = 0) -> int:
    """An integer from `least` up that the core can hold."""
    if isinstance(value, (bool, np.bool_)) or not hasattr(value, "__index__"):
        raise TypeError(f"{name} is {value!r}; an integer is wanted")
    result = value.__index__()
    if result < least:
        raise ValueError(f"{name} is {value}; it must be {f'at least {least}' if least else 'zero or positive'}")
    if result > LARGEST_COUNT:
        raise ValueError(f"{name} is {value}; it must be at most {LARGEST_COUNT}")
    return result


def saved_state(name: str, value: Any) -> bytes:
    """What `save_state` returned, or a copy of it in another kind of buffer."""
    if not isinstance(value, (bytes, bytearray, memoryview)):
        raise TypeError(f"{name} is a {type(value).__name__}; bytes from save_state are wanted")
    return bytes(value)


def array(name: str, value: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Finite float64 numbers of this shape, contiguous. May share memory with `value`."""
    try:
        result = np.ascontiguousarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise type(error)(f"{name}: not an array of numbers ({error})") from None
    if np.ndim(value) == 0 or result.shape != shape:
        raise ValueError(f"{name} has shape {np.shape(value)}; it must be {shape}")
    bad = np.argwhere(~np.isfinite(result))
    if len(bad):
        index = tuple(int(i) for i in bad[0])
        raise ValueError(f"{name}{list(index)} is {result[index]}; it must be finite")
    return result
