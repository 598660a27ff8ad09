"""Builds the comparison with MuJoCo, runs it, and writes benchmarks/results/<cpu>/<commit>.json and .md.

Called by `make bench` with the interpreter that has cmake, ninja, urdfdom, mujoco and example-robot-data. Options that are
not known here go to the program, for instance `--tasks hang --repetitions 15`.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import platform
import re
import subprocess
import sys
import sysconfig
from datetime import datetime, timezone
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def tool(name: str) -> str:
    """A program of this interpreter's environment, or else of the system."""
    own = Path(sysconfig.get_path("scripts")) / name
    return str(own) if own.exists() else name


def build(folder: Path) -> Path:
    subprocess.run(
        [
            *(tool("cmake"), "-S", ROOT, "-B", folder, "-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={tool('ninja')}"),
            *("-DCMAKE_BUILD_TYPE=Release", "-DSTICKSLIP_BENCHMARKS=ON", f"-DPython_EXECUTABLE={sys.executable}"),
        ],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    program = folder / "benchmarks" / "compare" / "stickslip_compare"
    if "stickslip_compare" not in (folder / "build.ninja").read_text():
        sys.exit(f"MuJoCo was not found. Install it with: {sys.executable} -m pip install mujoco==4.0.0")
    subprocess.run([tool("cmake"), "--build", folder, "--target", "stickslip_compare"], check=True)
    return program


def robots_folder() -> Path | None:
    """Where example-robot-data keeps its robots; None where it is not installed."""
    try:
        package = importlib.metadata.distribution("example-robot-data")
    except importlib.metadata.PackageNotFoundError:
        return None
    folder = Path(str(package.locate_file("cmeel.prefix/share/example-robot-data/robots")))
    return folder if folder.is_dir() else None


def cpu() -> str:
    """The processor's name as the system gives it."""
    try:
        found = re.search(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    except OSError:
        found = None
    return found[1].strip() if found else platform.processor() or platform.machine()


def commit() -> str:
    """Short hash of the commit, with -changed where the tree differs from it."""
    try:
        done = subprocess.run(
            ["git", "describe", "--always", "--exclude=*", "--dirty=-changed"],
            cwd=ROOT,
            check=True,
            capture_output=True,
            text=True,
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return done.stdout.strip()


def markdown(data: dict) -> str:
    """The results as a table for people."""
    lines = [
        f"# stickslip and MuJoCo {data['mujoco']}",
        "",
        f"{data['date']}, commit {data['commit']}, {data['cpu']}, {data['compiler']}. One thread, double, dt = 1 ms, "
        f"{data['repetitions']} repetitions of {data['steps']} steps in turns; medians. `benchmarks/README.md` has the rules.",
        "",
        "| task | engine | us/step | ratio | aim | contacts | pushing | penetration mean / max [mm] | energy [J] | residual max [m/s] (share > 1e-8) |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for result in data["results"]:
        for e in result["engines"]:
            ours = e["engine"] != "mujoco"
            energy = f"{e['energy_settled_J']:.1f} → {e['energy_at_end_J']:.1f}" if e["energy_settled_J"] else ""
            depth = f"{1e3 * e['mean_penetration_m']:.4f} / {1e3 * e['max_penetration_m']:.3f}" if e["contacts"] else ""
            cells = [
                result["task"],
                e["engine"] + (" **FAILED**: " + "; ".join(e["faults"]) if e["faults"] else ""),
                f"{e['us_per_step']:.2f}",
                f"{e['ratio']:.2f}" if ours and e["ratio"] else "",
                f"{e['target_ratio']:g}" if e["target_ratio"] else "",
                f"{e['contacts']:.2f}",
                f"{e['pushing_contacts']:.2f}",
                depth,
                energy,
                f"{e['max_residual_m_per_s']:.1e} ({e['share_above_1e-8']:.0e})" if ours else "",
            ]
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "bench", help="build folder")
    parser.add_argument("--output", type=Path, default=ROOT / "benchmarks" / "results", help="folder for the results")
    arguments, others = parser.parse_known_args()

    program = build(arguments.build.resolve())
    robots = robots_folder()
    if robots is None:
        print("example-robot-data is not installed: only ANYmal's tasks are run")
    raw = arguments.build.resolve() / "compare.json"
    raw.unlink(missing_ok=True)
    status = subprocess.run(
        [program, "--json", raw, *(["--robots", robots] if robots else []), *others], check=False
    ).returncode
    if not raw.exists():
        return status or 1

    data = json.loads(raw.read_text())
    data = {
        "commit": commit(),
        "cpu": cpu(),
        "system": platform.platform(),
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        **data,
    }
    folder = arguments.output / re.sub(r"[^A-Za-z0-9]+", "_", data["cpu"]).strip("_").lower()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{data['commit']}.json").write_text(json.dumps(data, indent=1) + "\n")
    (folder / f"{data['commit']}.md").write_text(markdown(data))
    print(f"results: {folder}/{data['commit']}.json, .md")
    return status


if __name__ == "__main__":
    sys.exit(main())
