"""What is written into a batch: numbers of any array library, indices, and what a parameter may be.

Every error names the property, what came and what is wanted; of one bad number it names environment and column.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

# As src/model/inertia.h and Robot::set_state judge a description and a state.
TRIANGLE_TOLERANCE = 1e-2
SMALLEST_MOMENT_RATIO = 1e-9
QUATERNION_TOLERANCE = 1e-3

_CPU = 1  # kDLCPU


@dataclass(frozen=True)
class Columns:
    """What the second axis of an array counts."""

    word: str  #: "joint"
    names: Sequence[str]


# Arrays in


def numbers(name: str, value: Any) -> NDArray[Any]:
    """Real numbers from NumPy, sequences, or anything with `__dlpack__` or `__array__`. May share memory with `value`."""
    result = _taken(name, value)
    if result.dtype.kind not in "fiu":
        raise TypeError(f"{name} holds {result.dtype.name}; real numbers of a NumPy type are wanted")
    return result


def fitted(name: str, value: Any, shape: tuple[int, ...]) -> NDArray[Any]:
    """Numbers that broadcast to `shape`, with all its axes; those that were left out have length 1."""
    result = numbers(name, value)
    try:
        np.broadcast_to(result, shape)
    except ValueError:
        raise ValueError(
            f"{name} has shape {result.shape}; it must be {shape}, {shape[1:]} for all environments alike, or one number"
        ) from None
    return result.reshape((1,) * (len(shape) - result.ndim) + result.shape)


def cast(values: NDArray[Any], dtype: np.dtype) -> NDArray[Any]:
    """As `dtype`; what is too large becomes infinite without a warning."""
    with np.errstate(over="ignore", invalid="ignore"):
        return values.astype(dtype, copy=False)


def per_element(name: str, value: Any, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Finite float32 numbers (shape), from one number or one per element. Read-only."""
    given = cast(numbers(name, value), np.dtype(np.float32))
    if given.shape not in ((), shape):
        raise ValueError(f"{name} has shape {given.shape}; it must be a number, or {shape}: one per element")
    if not np.isfinite(given).all():
        raise ValueError(f"{name} is {value}; it must be finite")
    return np.broadcast_to(given, shape)


def environments(name: str, where: Any, num_envs: int) -> NDArray[np.int64]:
    """Indices of a boolean mask (num_envs,), or integer indices, each in range and once."""
    given = _taken(name, where)
    if given.dtype.kind == "b":
        if given.shape != (num_envs,):
            raise ValueError(f"{name} is a mask of shape {given.shape}; a mask must be ({num_envs},)")
        return np.flatnonzero(given)
    indices = np.atleast_1d(given)
    if indices.shape == (0,):
        return np.empty(0, np.int64)
    if indices.dtype.kind not in "iu":
        raise TypeError(f"{name} holds {indices.dtype.name}; a boolean mask or integer indices are wanted")
    if indices.ndim != 1:
        raise ValueError(f"{name} has shape {indices.shape}; indices must be (k,), a mask ({num_envs},)")
    bad = np.flatnonzero((indices < 0) | (indices >= num_envs))
    if len(bad):
        raise IndexError(f"{name}[{bad[0]}] is {indices[bad[0]]}; environments are 0 to {num_envs - 1}")
    indices = indices.astype(np.int64)
    found, first, times = np.unique(indices, return_index=True, return_counts=True)
    if len(found) < len(indices):
        twice = np.argmax(times > 1)
        again = np.flatnonzero(indices == found[twice])[1]
        hint = "; a mask must be bool" if len(indices) == num_envs and found[-1] <= 1 else ""
        raise ValueError(
            f"{name}[{again}] is {found[twice]}, as is {name}[{first[twice]}]; name an environment once{hint}"
        )
    return indices


def states(name: str, value: Any, count: int, size: int, dtype: np.dtype) -> NDArray[np.float64]:
    """(count, size) finite float64 numbers from as many, or from (size,) for all."""
    given = numbers(name, value)
    if given.shape not in ((size,), (count, size)):
        raise ValueError(
            f"{name} has shape {given.shape}; it must be {(count, size)}, one row per environment that is reset, or "
            f"{(size,)} for all alike"
        )
    bad = np.argwhere(~np.isfinite(cast(given, dtype)))
    if len(bad):
        raise ValueError(f"{name}{bad[0].tolist()} is {_shown(given[tuple(bad[0])], dtype)}")
    return np.ascontiguousarray(np.broadcast_to(given, (count, size)), np.float64)


def _taken(name: str, value: Any) -> NDArray[Any]:
    """An array of whatever it holds."""
    try:
        if not isinstance(value, np.ndarray) and _exports_cpu_memory(value):
            try:
                return np.from_dlpack(value)
            except Exception:  # each library has its own errors; `asarray` may still take it, or says it better
                pass
        return np.asarray(value)
    except Exception as error:
        kind = TypeError if isinstance(error, (TypeError, RuntimeError)) else ValueError
        raise kind(f"{name}: a {type(value).__name__} that is not an array of numbers ({error})") from None


def _exports_cpu_memory(value: Any) -> bool:
    if not hasattr(value, "__dlpack__") or not hasattr(value, "__dlpack_device__"):
        return False
    return value.__dlpack_device__()[0] == _CPU


# Parameters. `values` has all axes of the parameter, some maybe of length 1 (see `fitted`).


def check_finite(name: str, values: NDArray[Any], dtype: np.dtype, columns: Columns) -> None:
    """ValueError where a number is not finite in the format of the batch."""
    bad = np.argwhere(~np.isfinite(cast(values, dtype)))
    if len(bad):
        raise ValueError(f"{_place(name, values, bad[0], columns)} is {_shown(values[tuple(bad[0])], dtype)}")


def check_not_negative(name: str, values: NDArray[Any], columns: Columns) -> None:
    """ValueError where a number is negative."""
    bad = np.argwhere(values < 0)
    if len(bad):
        raise ValueError(
            f"{_place(name, values, bad[0], columns)} is {values[tuple(bad[0])]}; it must be zero or positive"
        )


def check_masses(name: str, values: NDArray[Any], moves: NDArray[np.bool_], columns: Columns) -> None:
    """ValueError where a body that moves has no mass."""
    check_not_negative(name, values, columns)
    masses = np.broadcast_to(values, (values.shape[0], len(moves)))
    bad = np.argwhere((masses <= 0) & moves)
    if len(bad):
        raise ValueError(
            f"{_place(name, masses, bad[0], columns)} is {masses[tuple(bad[0])]}; a body that moves needs a positive mass [kg]"
        )


def check_inertias(name: str, values: NDArray[Any], moves: NDArray[np.bool_], columns: Columns) -> None:
    """ValueError where no body can have this inertia xx xy xz yy yz zz."""
    inertias = np.broadcast_to(values, (values.shape[0], len(moves), 6))
    full = inertias[..., [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(*inertias.shape[:2], 3, 3)
    moments = np.linalg.eigvalsh(full.astype(np.float64))
    a, b, c = np.moveaxis(moments, -1, 0)
    flat = ~(a > SMALLEST_MOMENT_RATIO * c)
    bad = np.argwhere((flat | (c > a + b + TRIANGLE_TOLERANCE * c)) & moves)
    if len(bad):
        at = tuple(bad[0])
        defect = "is not positive definite" if flat[at] else "breaks the triangle inequality"
        raise ValueError(
            f"{_place(name, inertias, bad[0], columns)} {defect} (principal moments "
            f"{', '.join(f'{moment:.4g}' for moment in moments[at])} kg m^2); the order is xx xy xz yy yz zz"
        )


def check_quaternions(name: str, values: NDArray[Any], nq: int) -> None:
    """ValueError where the base quaternion of q (..., nq) is not near unit length."""
    parts = np.broadcast_to(values, (values.shape[0], nq))[:, 3:7].astype(np.float64)
    lengths = np.sqrt(np.sum(parts * parts, axis=1))
    bad = np.argwhere(~(np.abs(lengths - 1) <= QUATERNION_TOLERANCE))
    if len(bad):
        raise ValueError(
            f"{_environment(name, values, bad[0])}, base quaternion (w, x, y, z) at [3:7] has length "
            f"{lengths[bad[0][0]]:.6g}; it must be a unit quaternion"
        )


def _environment(name: str, values: NDArray[Any], index: NDArray[np.intp]) -> str:
    return f"{name}: every environment" if values.shape[0] == 1 else f"{name}: environment {index[0]}"


def _place(name: str, values: NDArray[Any], index: NDArray[np.intp], columns: Columns) -> str:
    """As in "kp: environment 3, joint 'knee'"."""
    text = _environment(name, values, index)
    if len(index) > 1:
        one = values.shape[1] == 1 and len(columns.names) > 1 and index[1] == 0
        text += f", every {columns.word}" if one else f", {columns.word} {columns.names[index[1]]!r}"
    return text + (f" [{index[2]}]" if len(index) > 2 else "")


def _shown(value: Any, dtype: np.dtype) -> str:
    wanted = f"too large for {dtype.name}" if np.isfinite(value) else "it must be finite"
    return f"{value}; {wanted}"
