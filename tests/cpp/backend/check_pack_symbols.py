"""Object files of a pack share no function with code for other instructions.

The linker keeps one copy of every weak function, from whichever object file comes first. One that is compiled for AVX-512 in a
pack and also used elsewhere would crash machines without it. So all that a pack defines for others must carry the name of its
instruction set, and what it takes from others must be on a short list.

    check_pack_symbols.py --nm NM --instruction-set avx512 FILE...
"""

from __future__ import annotations

import argparse
import subprocess
import sys

# Undefined: the compiler itself calls these.
COMPILER_CALLS = {"memcpy", "memmove", "memset", "memcmp", "__stack_chk_fail", "_GLOBAL_OFFSET_TABLE_"}
SANITIZERS = ("__asan_", "__ubsan_", "__tsan_")


def symbols(nm: str, path: str) -> list[tuple[str, str]]:
    """(type, mangled name) of all symbols, as nm calls them."""
    lines = subprocess.run([nm, "-P", path], check=True, capture_output=True, text=True).stdout.splitlines()
    return [(fields[1], fields[0]) for fields in map(str.split, lines) if len(fields) >= 2]


def is_local(kind: str) -> bool:
    return kind.islower() and kind not in "uvw"


def is_allowed(kind: str, name: str, instruction_set: str) -> bool:
    if is_local(kind):
        return True
    if f"{len(instruction_set)}{instruction_set}" in name:  # as a namespace in a mangled name
        return True
    if kind in "Uw":
        return name.lstrip("_") in {call.lstrip("_") for call in COMPILER_CALLS} or name.startswith(SANITIZERS)
    # The table of functions that all of it is for.
    return kind in "DRB" and f"pack_{instruction_set}_" in name


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--nm", required=True)
    parser.add_argument("--instruction-set", required=True)
    parser.add_argument("files", nargs="+")
    args = parser.parse_args()
    bad = 0
    for path in args.files:
        found = symbols(args.nm, path)
        if not any(not is_local(kind) and kind not in "Uw" for kind, _ in found):
            print(f"{path}: defines nothing; is it an object file of a pack?")
            bad += 1
        for kind, name in found:
            if not is_allowed(kind, name, args.instruction_set):
                print(f"{path}: {kind} {name}")
                bad += 1
    return bad > 0


if __name__ == "__main__":
    sys.exit(main())
