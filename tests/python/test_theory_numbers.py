"""Every equation number that the code cites exists in docs/theory."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("include", "src", "scenes", "python", "tests/cpp", "benchmarks")


def test_cited_equations_exist():
    defined = set()
    for page in (ROOT / "docs/theory").glob("*.md"):
        # A definition stands at the end of a line; text cites in the middle of one.
        defined |= set(re.findall(r"\(([A-Z]\d+)\)\s*$", page.read_text(), re.M))
    assert {"C1", "C3", "C38"} <= defined
    missing = []
    for folder in FOLDERS:
        for path in (ROOT / folder).rglob("*"):
            if path.suffix in (".h", ".cc", ".py"):
                for number in re.findall(r"\((C\d+)\)", path.read_text()):
                    if number not in defined:
                        missing.append(f"{path.relative_to(ROOT)} cites ({number})")
    assert not missing
