"""Numbers as text."""

from __future__ import annotations

import math
from collections.abc import Sequence


def number(value: float, digits: int = 3) -> str:
    """So many significant digits, thousands separated, small and large ones as powers of ten."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if size < -3 or size >= 7:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
        return f"{mantissa}·10<sup>{int(exponent)}</sup>".replace("-", "−")
    return f"{round(value, digits - 1 - size):,.{max(digits - 1 - size, 0)}f}".replace(",", "\u202f").replace("-", "−")


def count(value: float) -> str:
    """A whole number, thousands separated."""
    return f"{round(value):,}".replace(",", "\u202f")


def percent(share: float) -> str:
    """A share as percent, with digits where they matter (near 0 and near 1)."""
    value = 100 * share
    if value in (0.0, 100.0):
        return f"{value:.0f}\u00a0%"
    if value < 0.1 or 99.9 < value < 100:
        return f"{value:.3f}\u00a0%"
    if value >= 99.95:
        return f"{value:.0f}\u00a0%"
    return f"{value:.1f}\u00a0%"


def millimetres(metres: float | None) -> str:
    """A length; below a nanometre it is said so and no more."""
    if metres is None:
        return "–"
    return "&lt; 10<sup>−6</sup>" if 0 < metres < 1e-9 else number(1e3 * metres, 2)


def times(ratio: float) -> str:
    """A ratio as in "2.1 times"."""
    return f"{number(ratio, 2)} times"


def listed(items: Sequence[str]) -> str:
    """a, b and c."""
    if len(items) < 2:
        return "".join(items)
    return f"{', '.join(items[:-1])} and {items[-1]}"


def spread(values: Sequence[float], digits: int = 2) -> str:
    """ "3.1 to 5.2", or one number where they agree."""
    low, high = number(min(values), digits), number(max(values), digits)
    return low if low == high else f"{low} to {high}"


def geometric_mean(values: Sequence[float]) -> float:
    """exp of the mean of the logarithms."""
    return math.exp(sum(math.log(v) for v in values) / len(values))
