"""Builds the comparison with MuJoCo, runs it, and writes benchmarks/results/<cpu>/<commit>.json and .md.

Called by `make bench` with the interpreter that has cmake, ninja, urdfdom, mujoco and example-robot-data. Options that are
not known here go to the program, for instance `--tasks hang --repetitions 100`. `--markdown docs/throughput.md` puts the
speeds into that page, `--from results.json` takes them from an earlier run.
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
        f"{measured_on(data)}, {data['compiler']}. dt = 1 ms, "
        f"{data['repetitions']} repetitions of {data['steps']} steps in turns, batches of {data['robots']} robots. "
        "`benchmarks/README.md` has the rules.",
        "",
        "| task | engine | us/step | steps/s | ratio | aim | contacts | pushing | penetration mean / max [mm] | energy [J] | residual 99.99 % / max [m/s] (share above) |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for result in data["results"]:
        for e in result["engines"]:
            lines.append("| " + " | ".join([result["task"], *cells(e)]) + " |")
    return "\n".join(lines) + "\n"


def measured_on(data: dict) -> str:
    """When, with what and where; batches that do not say otherwise run on the widest instructions there."""
    widest = next((e["instruction_set"] for r in data["results"] for e in r["engines"] if e.get("instruction_set")), "")
    return f"{data['date']}, commit {data['commit']}, {data['cpu']}" + (f" with {widest}" if widest else "")


def cells(e: dict) -> list[str]:
    """One engine's row."""
    name = e["engine"] + (" **FAILED**: " + "; ".join(e["faults"]) if e["faults"] else "")
    if not e["us_per_repetition"]:  # it could not be run
        return [name, *[""] * 9]
    watched = e["steps"] > 0  # not with --no-statistics
    ours = "max_residual_m_per_s" in e
    energy = f"{e['energy_settled_J']:.1f} → {e['energy_at_end_J']:.1f}" if e["energy_settled_J"] else ""
    depth = (
        f"{1e3 * e['mean_penetration_m']:.4f} / {1e3 * e['max_penetration_m']:.3f}" if watched and e["contacts"] else ""
    )
    residual = (
        f"{e['residual_99_99_m_per_s']:.0e} / {e['max_residual_m_per_s']:.0e} "
        f"({e['share_above_tolerance']:.0e} > {e['residual_tolerance_m_per_s']:.0e})"
        if ours and watched
        else ""
    )
    return [
        name,
        f"{e['us_per_step']:.3f}",
        f"{e['robot_steps_per_s'] / 1e6:.3f} M",
        f"{e['ratio']:.2f}" if e["ratio"] else "",
        f"{e['target_ratio']:.3g}" if e["target_ratio"] else "",
        f"{e['contacts']:.2f}" if watched else "",
        f"{e['pushing_contacts']:.2f}" if watched else "",
        depth,
        energy,
        residual,
    ]


BEGIN, END = "<!-- speeds: written by benchmarks/compare/run.py --markdown -->", "<!-- end of speeds -->"


def speeds(data: dict) -> str:
    """How fast every engine is on every task: a row per engine, and what that is relative to MuJoCo."""
    lines = [f"{measured_on(data)}, MuJoCo {data['mujoco']}, {data['compiler']}:", ""]
    for group in (data["results"][:5], data["results"][5:]):
        if not group:
            continue
        engines = list(dict.fromkeys(e["engine"] for result in group for e in result["engines"]))
        lines += [
            "| us per robot-step (ratio) | " + " | ".join(result["task"] for result in group) + " |",
            "|---|" + "---:|" * len(group),
        ]
        for engine in engines:
            found = [{e["engine"]: e for e in result["engines"]}.get(engine) for result in group]
            lines.append(f"| {engine} | " + " | ".join(speed(e) for e in found) + " |")
        lines.append("")
    return "\n".join(lines)


def speed(e: dict | None) -> str:
    """As in "0.125 (66)"."""
    if e is None or not e["us_per_repetition"]:
        return ""
    return f"{e['us_per_step']:.3f}" + (f" ({e['ratio']:.3g})" if e["ratio"] else "")


def write_speeds(data: dict, page: Path) -> None:
    """Puts them between the marks of a page."""
    text = page.read_text(encoding="utf-8")
    if text.count(BEGIN) != 1 or text.count(END) != 1:
        sys.exit(f"{page}: the marks {BEGIN} and {END} must be there once each")
    before, rest = text.split(BEGIN)
    page.write_text(before + BEGIN + "\n" + speeds(data) + END + rest.split(END)[1], encoding="utf-8")
    print(f"speeds: {page}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "bench", help="build folder")
    parser.add_argument("--output", type=Path, default=ROOT / "benchmarks" / "results", help="folder for the results")
    parser.add_argument(
        "--markdown", type=Path, metavar="PAGE", help="put the speeds into this page, between its marks"
    )
    parser.add_argument(
        "--from", dest="earlier", type=Path, metavar="JSON", help="results of an earlier run; nothing is run"
    )
    arguments, others = parser.parse_known_args()
    if arguments.earlier is not None:
        data = json.loads(arguments.earlier.read_text())
        write_speeds(data, arguments.markdown) if arguments.markdown else print(speeds(data))
        return 0

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
    if arguments.markdown is not None:
        write_speeds(data, arguments.markdown)
    return status


if __name__ == "__main__":
    sys.exit(main())
