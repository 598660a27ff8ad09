"""The order of a contact's components, FCLIB's and ours.

FCLIB: normal first, (n, t1, t2), in the plane (n, t). Ours: normal last, (x, y, z) = (t1, t2, n), in the plane (x, z) = (t, n).
Both are the same right-handed axes, in turn.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def our_rows(rows: int, spacedim: int) -> NDArray[np.int64]:
    """(rows,): which of our rows each of FCLIB's is. `ours[our_rows] = theirs`, `theirs = ours[our_rows]`."""
    component = np.arange(rows) % spacedim
    return np.arange(rows) - component + (component - 1) % spacedim
