"""From masses to the Delassus operator: symmetric parts, and H' M^-1 H with a sparse factor of M."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

Array = NDArray[np.float64]

ROUNDING = 1e-9  # of the largest entry: what ContactProblem takes for rounding too
FEW_DIGITS = 1e-2  # what is left of symmetry where a file was written in few digits
_COLUMNS = 256  # right-hand sides at a time
_ENTRIES = 1 << 25  # of a block of right-hand sides: 256 MB


def symmetric(matrix: sp.csr_array, name: str) -> tuple[sp.csr_array, str]:
    """(A + A') / 2, and a text that says how far A was from it, empty up to rounding.

    ValueError beyond `FEW_DIGITS` of the largest entry.
    """
    half = 0.5 * matrix  # first, so that two entries near the largest double do not overflow
    apart = sp.coo_array(half - half.T)
    worst = int(np.argmax(np.abs(apart.data))) if apart.nnz else -1
    if worst < 0:
        return matrix, ""
    difference, largest = 2 * abs(apart.data[worst]), np.abs(matrix.data).max()
    row, column = sorted((int(apart.row[worst]), int(apart.col[worst])))
    order = " (rows in the order x, y, z)" if name == "W" else ""
    says = (
        f"{name} is not symmetric: [{row}, {column}] and [{column}, {row}]{order} differ by {difference:.3g}, "
        f"{difference / largest:.2g} of the largest entry"
    )
    if not difference <= FEW_DIGITS * largest:
        raise ValueError(f"{says}; at most {FEW_DIGITS:g} is mended")
    return sp.csr_array(half + half.T), says if difference > ROUNDING * largest else ""


class PositiveDefinite:
    """A sparse factor of a symmetric positive definite matrix. ValueError with `name` if it is singular or indefinite."""

    def __init__(self, matrix: sp.csr_array, name: str):
        self._name = name
        # The factor keeps to the diagonal as long as it can: pivots of a positive definite matrix are positive there, and
        # their product with a unit lower factor is as stable as Cholesky's.
        try:
            self._factor = splu(
                sp.csc_array(matrix),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError:  # SuperLU: exactly singular
            raise ValueError(f"{name} is singular; it must be positive definite") from None
        if not np.array_equal(self._factor.perm_r, self._factor.perm_c):
            raise ValueError(f"{name} is indefinite (a pivot is zero); it must be positive definite")
        diagonal = matrix.diagonal()
        pivots = self._factor.U.diagonal()[self._factor.perm_c]
        # A pivot is what elimination leaves of its diagonal entry; below this it is rounding.
        bad = np.flatnonzero(~(pivots > len(pivots) * np.finfo(float).eps * np.abs(diagonal)))
        if len(bad):
            k = bad[0]
            kind = "indefinite" if pivots[k] < -1e-9 * abs(diagonal[k]) else "singular to working precision"
            raise ValueError(
                f"{name} is {kind}: elimination leaves {pivots[k]:.3g} of [{k}, {k}] = {diagonal[k]:.3g}; "
                "it must be positive definite"
            )

    def congruence(self, H: sp.csr_array) -> sp.csr_array:
        """H' A^-1 H, symmetric to the bit."""
        columns = H.tocsc()
        step = max(1, min(_COLUMNS, _ENTRIES // H.shape[0]))
        parts = []
        for start in range(0, H.shape[1], step):
            solved = self.solve(columns[:, start : start + step].toarray())
            parts.append(sp.csc_array(H.T @ solved))
        result = sp.csr_array(sp.hstack(parts, format="csr"))
        return sp.csr_array(0.5 * result + 0.5 * result.T)

    def solve(self, right: Array) -> Array:
        """A^-1 of a vector or of columns."""
        with np.errstate(all="ignore"):
            result = self._factor.solve(right)
        if not np.isfinite(result).all():
            raise ValueError(f"{self._name}: its inverse overflows")
        return result


def schur(M: sp.csr_array, H: sp.csr_array, f: Array, name: str) -> tuple[sp.csr_array, Array]:
    """H' M^-1 H and H' M^-1 f."""
    if M.shape[0] == 0 or H.shape[1] == 0:
        return sp.csr_array((H.shape[1], H.shape[1])), np.zeros(H.shape[1])
    factor = PositiveDefinite(M, name)
    with np.errstate(all="ignore"):
        W, q = factor.congruence(H), H.T @ factor.solve(f)
    if not (np.isfinite(W.data).all() and np.isfinite(q).all()):
        raise ValueError(f"{name}: products with its inverse overflow")
    return W, q
