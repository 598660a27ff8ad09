"""Builds the comparison of contact solvers, runs it, and writes tables and a performance profile.

Needs cmake, ninja, pin, numpy and matplotlib in this interpreter's environment. Options that are not known here go
to the program, for instance `--sets quadruped --rounds 9`.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import results

ROOT = Path(__file__).resolve().parents[2]
# Debian's Siconos (numerics only) and what its library links, apart from libc, zlib, bz2 and lzma.
SICONOS_PACKAGES = [
    *("libsiconos-numerics7", "libsiconos-numerics-dev", "libcxsparse3", "libldl2", "liblapacke", "libtmglib3"),
    *("libmumps-seq-5.5", "libscotch-7.0", "libmetis5", "libsuitesparseconfig5", "libopenblas0-pthread"),
    *("libblas3", "liblapack3", "libgfortran5", "libquadmath0"),
]


def compare_tools():
    """benchmarks/compare/run.py: the same ways to find tools and to name the commit."""
    spec = importlib.util.spec_from_file_location("compare_run", ROOT / "benchmarks" / "compare" / "run.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


COMPARE = compare_tools()


def unpack_siconos(folder: Path) -> Path:
    """Downloads Debian's packages into the folder and unpacks them there, without root; returns its usr/."""
    usr = folder / "usr"
    if not (usr / "include" / "siconos").is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        subprocess.run(["apt-get", "download", *SICONOS_PACKAGES], cwd=folder, check=True)
        for package in sorted(folder.glob("*.deb")):
            subprocess.run(["dpkg", "-x", package, folder], check=True)
    return usr


def build(folder: Path, siconos: Path | None) -> Path:
    tool = COMPARE.tool
    subprocess.run(
        [
            *(tool("cmake"), "-S", ROOT, "-B", folder, "-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={tool('ninja')}"),
            *("-DCMAKE_BUILD_TYPE=Release", "-DSTICKSLIP_BENCHMARKS=ON", f"-DPython_EXECUTABLE={sys.executable}"),
            *([f"-DSTICKSLIP_SICONOS={siconos}"] if siconos else []),
        ],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    if "stickslip_contact_compare" not in (folder / "build.ninja").read_text():
        sys.exit(f"Pinocchio was not found. Install it with: {sys.executable} -m pip install pin==4.1.0")
    subprocess.run([tool("cmake"), "--build", folder, "--target", "stickslip_contact_compare"], check=True)
    return folder / "benchmarks" / "contact" / "stickslip_contact_compare"


def version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "of unknown version"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "bench", help="build folder")
    parser.add_argument(
        "--siconos",
        help="folder with include/siconos and lib/ (an unpacked Debian package's usr/), or 'download': Debian's packages "
        "into the build folder; without it the system's Siconos, if it has one",
    )
    parser.add_argument("--check", action="store_true", help="exit status 1 where an aim is missed")
    parser.add_argument("--report-only", action="store_true", help="do not run: tables and plot of the last run")
    arguments, others = parser.parse_known_args()

    folder = arguments.build.resolve()
    raw = folder / "contact.json"
    if not arguments.report_only:
        siconos = arguments.siconos
        if siconos is not None:
            siconos = unpack_siconos(folder / "siconos") if siconos == "download" else Path(siconos).resolve()
        program = build(folder, siconos)
        raw.unlink(missing_ok=True)
        # One core is what is compared: a BLAS with threads would use another one.
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        status = subprocess.run([program, "--json", raw, *others], check=False, env=environment).returncode
        if status or not raw.exists():
            return status or 1
    elif not raw.exists():
        sys.exit(f"{raw} does not exist: run without --report-only first")

    data = json.loads(raw.read_text())
    sets = results.read(data)
    head = (
        f"# Contact solvers\n\nCommit {COMPARE.commit()}, {COMPARE.cpu()}, {data['compiler']}; Pinocchio {version('pin')}. One "
        "thread, double, cold start, methods in turns; benchmarks/contact/README.md has the rules.\n\n"
    )
    aims = results.aims(sets) if results.OURS in sets[0].solvers() else []
    lines = "".join(f"- {'met' if a.met else '**missed**'}: {a.text}\n" for a in aims)
    (folder / "contact.md").write_text(head + lines + "\n" + results.markdown(sets))
    results.plot(sets, folder / "contact.png")
    for aim in aims:
        print(f"{'met   ' if aim.met else 'missed'} {aim.text}")
    print(f"tables: {folder}/contact.md, performance profile: {folder}/contact.png")
    return 1 if arguments.check and not all(aim.met for aim in aims) else 0


if __name__ == "__main__":
    sys.exit(main())
