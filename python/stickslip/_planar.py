"""Problems in the plane x, z, two rows per contact, and the same ones in space, whose y rows are zero."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip._arguments import array

if TYPE_CHECKING:
    from scipy import sparse

Array = NDArray[np.float64]


def planar_rows(contacts: int) -> NDArray[np.int64]:
    """(2n,): the rows x and z of each contact among 3n."""
    return (3 * np.arange(contacts)[:, None] + [0, 2]).reshape(-1)


def planar_to_spatial(
    delassus: ArrayLike | sparse.sparray, free_velocity: ArrayLike, friction: ArrayLike
) -> tuple[Array | sparse.csr_array, Array, Array]:
    """(3n, 3n), (3n,), (n,) of a problem in the plane: nothing moves along y, whose rows and columns are zero.

    delassus: (2n, 2n) [1/kg], an array or a SciPy sparse matrix (then the result is a csr_array); free_velocity: (2n,) [m/s];
    friction: (n,); in the order x, z (normal) per contact. ValueError names the argument that does not fit.
    """
    try:
        mu = np.asarray(friction, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise type(error)(f"friction: not an array of numbers ({error})") from None
    if mu.ndim != 1:
        raise ValueError(f"friction has shape {mu.shape}; it must be (n,)")
    n = len(mu)
    rows = planar_rows(n)
    velocity = np.zeros(3 * n)
    velocity[rows] = _fitting("free_velocity", free_velocity, (2 * n,), n)
    if hasattr(delassus, "tocoo"):
        from scipy import sparse

        _check_shape("delassus", delassus, (2 * n, 2 * n), n)
        entries = sparse.coo_array(delassus, dtype=np.float64)
        spatial = sparse.csr_array(
            (entries.data, (rows[entries.row], rows[entries.col])), shape=(3 * n, 3 * n), dtype=np.float64
        )
        return spatial, velocity, mu
    dense = np.zeros((3 * n, 3 * n))
    dense[np.ix_(rows, rows)] = _fitting("delassus", delassus, (2 * n, 2 * n), n)
    return dense, velocity, mu


def spatial_to_planar(delassus: ArrayLike | sparse.sparray, free_velocity: ArrayLike) -> tuple[sparse.csr_array, Array]:
    """(2n, 2n) and (2n,) in the order x, z of a problem that lives in that plane.

    ValueError names the first contact that has something along y.
    """
    from scipy import sparse

    W, q = sparse.coo_array(delassus, dtype=np.float64), np.asarray(free_velocity, dtype=np.float64)
    out = (W.data != 0) & ((W.row % 3 == 1) | (W.col % 3 == 1))
    if out.any():
        k = int(np.argmax(out))
        raise ValueError(
            f"delassus[{W.row[k]}, {W.col[k]}] is {W.data[k]}; a problem in the plane (spacedim=2) has zeros along y"
        )
    if np.any(q[1::3]):
        k = 3 * int(np.flatnonzero(q[1::3])[0]) + 1
        raise ValueError(f"free_velocity[{k}] is {q[k]}; a problem in the plane (spacedim=2) has zeros along y")
    rows = planar_rows(len(q) // 3)
    return W.tocsr()[rows][:, rows], q[rows]


def _fitting(name: str, value: ArrayLike, shape: tuple[int, ...], contacts: int) -> Array:
    _check_shape(name, value, shape, contacts)
    return array(name, value, shape)


def _check_shape(name: str, value: Any, shape: tuple[int, ...], contacts: int) -> None:
    try:
        found = np.shape(value)
    except ValueError:  # rows of different lengths, which `array` tells
        return
    if found != shape:
        raise ValueError(
            f"{name} has shape {found}; it must be {shape} for {contacts} contacts in the plane (as many as friction has)"
        )
