"""The order of a contact's components, FCLIB's and ours, and problems in the plane.

FCLIB: normal first, (n, t1, t2), in the plane (n, t). Ours: normal last, (x, y, z) = (t1, t2, n), in the plane (x, z) = (t, n).
Both are the same right-handed axes, in turn.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from stickslip._arguments import array

Array = NDArray[np.float64]
Matrix = NDArray[np.float64] | sp.sparray | sp.spmatrix


def our_rows(rows: int, spacedim: int) -> NDArray[np.int64]:
    """(rows,): which of our rows each of FCLIB's is. `ours[our_rows] = theirs`, `theirs = ours[our_rows]`."""
    component = np.arange(rows) % spacedim
    return np.arange(rows) - component + (component - 1) % spacedim


def _spatial_rows(contacts: int) -> NDArray[np.int64]:
    """(2n,): the rows x and z of each contact among 3n."""
    return (3 * np.arange(contacts)[:, None] + [0, 2]).reshape(-1)


def planar_to_spatial(W2: ArrayLike | Matrix, q2: ArrayLike, mu: ArrayLike) -> tuple[Matrix, Array, Array]:
    """(3n, 3n), (3n,), (n,) of a problem in the plane x, z: nothing moves along y, whose rows and columns are zero.

    W2: (2n, 2n) [1/kg], an array or a SciPy sparse matrix (then the result is a csr_array); q2: (2n,) [m/s]; mu: (n,); in the
    order x, z (normal) per contact.
    """
    friction = np.atleast_1d(np.asarray(mu, dtype=np.float64))
    rows = _spatial_rows(len(friction))
    wanted = (len(rows), len(rows))
    if np.shape(W2) != wanted:
        raise ValueError(f"W2 has shape {np.shape(W2)}; it must be {wanted} for {len(friction)} contacts in the plane")
    q = np.zeros(3 * len(friction))
    q[rows] = array("q2", q2, (len(rows),))
    if sp.issparse(W2):
        w = sp.coo_array(W2, dtype=np.float64)
        return sp.csr_array((w.data, (rows[w.row], rows[w.col])), shape=(len(q), len(q))), q, friction
    W = np.zeros((len(q), len(q)))
    W[np.ix_(rows, rows)] = np.asarray(W2, dtype=np.float64)
    return W, q, friction


def spatial_to_planar(delassus: ArrayLike | Matrix, free_velocity: ArrayLike) -> tuple[sp.csr_array, Array]:
    """(2n, 2n) and (2n,) in the order x, z of a problem that lives in that plane.

    ValueError names the first contact that has something along y.
    """
    W, q = sp.coo_array(delassus, dtype=np.float64), np.asarray(free_velocity, dtype=np.float64)
    out = (W.data != 0) & ((W.row % 3 == 1) | (W.col % 3 == 1))
    if out.any():
        k = int(np.argmax(out))
        raise ValueError(
            f"delassus[{W.row[k]}, {W.col[k]}] is {W.data[k]}; a problem in the plane (spacedim=2) has zeros along y"
        )
    if np.any(q[1::3]):
        k = 3 * int(np.flatnonzero(q[1::3])[0]) + 1
        raise ValueError(f"free_velocity[{k}] is {q[k]}; a problem in the plane (spacedim=2) has zeros along y")
    rows = _spatial_rows(len(q) // 3)
    return W.tocsr()[rows][:, rows], q[rows]
