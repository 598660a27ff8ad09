"""The instruction sets that the core was compiled for, checked before it is loaded."""

from __future__ import annotations

import platform
from pathlib import Path

# One fused multiply-add per `madd` is part of the promise of equal bits, so there is no slower fallback.
_WANTED = ("avx2", "fma", "bmi2")
_CPUINFO = Path("/proc/cpuinfo")


def check() -> None:
    """Raises ImportError on a processor without AVX2 and FMA (before 2013), where the core would crash."""
    if platform.machine() not in ("x86_64", "AMD64"):
        return
    try:
        with _CPUINFO.open(encoding="ascii", errors="replace") as lines:
            flags = next((line.split() for line in lines if line.startswith("flags")), None)
    except OSError:
        return
    missing = [flag for flag in _WANTED if flags is not None and flag not in flags]
    if missing:
        raise ImportError(
            f"stickslip needs a processor with AVX2 and FMA (x86-64-v3); this one lacks {', '.join(missing)}"
        )
