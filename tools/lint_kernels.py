#!/usr/bin/env python3
"""Checks the kernel rules that a grep can see (CONTRIBUTING.md: one source for double, SIMD lanes and GPU threads).

Kernels hold only our own arithmetic and include only kernels: no standard library, no libm, no Eigen, no approximate
reciprocals, no exceptions, no allocation. The host side may use the standard library, but nothing that makes bits depend on
the machine or the run. Prints `file:line: what (why)` and exits 1 when it finds something.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

KERNEL_FOLDERS = ("lane", "spatial", "dynamics", "collide", "contact", "step")
# The host side (models, worlds, batches, solvers of the public API): held to the rules that keep bits equal, free to use
# the standard library.
HOST_FOLDERS = ("model", "layout", "solvers", "world", "backend")
# Kernels in a folder of the host side: what is compiled per instruction set.
KERNEL_FILES = {"backend/cpu/pack_kernels.cc", "backend/cpu/pack_kernels.h", "backend/cpu/pack_lanes.h"}

# Where a library's linear algebra serves: systems beyond robot size, which no step solves.
LIBRARY_FILES = {"solvers/large_system.cc", "solvers/minimum_norm.cc"}
# Compiler headers with vector instructions, only where the pack is made of them.
INTRINSICS = {"lane/pack.h": ("immintrin.h", "arm_neon.h")}

LIBM = "sin|cos|tan|asin|acos|atan|atan2|sincos|sinh|cosh|tanh|exp|exp2|expm1|log|log2|log10|log1p|pow|cbrt|hypot"

# (pattern, why); matched outside comments and strings.
EVERYWHERE = [
    (rf"\bstd::({LIBM}|fma)\b", "libm differs between machines; use lane/math.h"),
    (r"rsqrt|rcp(14|28)?_p[sd]|vrecpe|vrsqrte|\b__fdividef\b", "approximate reciprocals differ between processors"),
    (r"fast-math|fast_math|fp-contract|FP_CONTRACT|associative-math", "the compiler may not choose the rounding"),
    (r"\bunordered_(map|set|multimap|multiset)\b", "its order is not part of any contract"),
    (r"\bstd::(random_device|mt19937|uniform_\w+_distribution|normal_distribution)\b", "no randomness in a step"),
    (r"\bstd::(reduce|transform_reduce)\b|\bstd::execution\b", "its order of operations is free"),
]
NO_LIBRARY = [(r"\bEigen\b", "Eigen is for systems beyond robot size, loading and tests")]
KERNEL = [
    (r"\bstd::", "kernels use no standard library"),
    (rf"\b__builtin_({LIBM})f?\b", "libm differs between machines; use lane/math.h"),
    (r"\b(throw|try|catch)\b", "no exceptions in a kernel"),
    (r"\b(new|delete)\b|\b(malloc|calloc|free)\s*\(", "no allocation in a kernel"),
    (r"\b(virtual|dynamic_cast|typeid)\b", "no run-time types in a kernel"),
    (r"\b(long double|__float128)\b", "not a lane type"),
]


def without_comments(text: str) -> str:
    """The text with comments and strings blanked, lines kept."""

    def blank(match: re.Match[str]) -> str:
        return re.sub(r"[^\n]", " ", match[0])

    return re.sub(r"//[^\n]*|/\*.*?\*/|\"(?:\\.|[^\"\\\n])*\"", blank, text, flags=re.S)


def is_kernel(name: str) -> bool:
    """Of a path below src, as an #include spells it."""
    return ".." not in name and (name.split("/")[0] in KERNEL_FOLDERS or name in KERNEL_FILES)


def findings(path: Path, name: str) -> list[str]:
    """What breaks a rule in the file that is called `name` below src."""
    kernel = is_kernel(name)
    rules = EVERYWHERE + (KERNEL if kernel else []) + ([] if name in LIBRARY_FILES else NO_LIBRARY)
    result = []
    text = path.read_text(encoding="utf-8")
    for number, line in enumerate(text.splitlines() if kernel else [], 1):
        include = re.match(r"\s*#\s*include\s*[<\"]([^>\"]+)", line)
        if include and not is_kernel(include[1]) and include[1] not in INTRINSICS.get(name, ()):
            result.append(f"{path}:{number}: #include {include[1]} (kernels include only kernels)")
    for number, line in enumerate(without_comments(text).splitlines(), 1):
        for pattern, why in rules:
            if found := re.search(pattern, line):
                result.append(f"{path}:{number}: {found[0].strip()} ({why})")
    return result


def main() -> int:
    source = Path(__file__).resolve().parent.parent / "src"
    files = sorted(
        path
        for folder in (*KERNEL_FOLDERS, *HOST_FOLDERS)
        for path in (source / folder).rglob("*")
        if path.suffix in (".h", ".inl", ".cc", ".cu")
    )
    missing = [name for name in sorted(LIBRARY_FILES | KERNEL_FILES) if not (source / name).is_file()]
    found = [f"{name}: listed here, but there is no such file" for name in missing]
    found += [line for path in files for line in findings(path, path.relative_to(source).as_posix())]
    print("\n".join(found) if found else f"kernel rules: {len(files)} files, nothing found")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
