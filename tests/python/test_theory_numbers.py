"""What the code and the pages of docs/ cite exists: equation numbers, references, linked files."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("include", "src", "scenes", "python", "tests/cpp", "tests/physics", "benchmarks")
SOURCES = sorted(
    path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.suffix in (".h", ".cc", ".inl", ".py")
)
PAGES = [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
# C: contact.md and, from C20 on, solvers.md; D: dynamics.md, S: step.md. A definition stands at the end of a line; text cites in the middle of one.
DEFINITION = re.compile(r"  \(([CDS]\d+)\)[ \t]*$", re.M)
CITATION = re.compile(r"\b([CDS]\d{1,2})\b(?=[),\s\-])")


def _defined() -> list[str]:
    return [number for page in (ROOT / "docs/theory").glob("*.md") for number in DEFINITION.findall(page.read_text())]


def _cited(text: str) -> set[str]:
    """Numbers in parentheses, as in (C3), (S9)-(S12) or (D7, D8)."""
    return {number for inside in re.findall(r"\(([^()]*)\)", text) for number in CITATION.findall(inside + ")")}


def test_each_equation_number_is_defined_once():
    numbers = _defined()
    assert {"C1", "C3", "C19", "C20", "C38", "C46", "C63", "C70", "D1", "D16", "S1", "S9", "S12"} <= set(numbers)
    assert len(numbers) == len(set(numbers))


@pytest.mark.parametrize("files", [SOURCES, PAGES], ids=["code", "docs"])
def test_cited_equations_exist(files):
    defined = set(_defined())
    missing = [
        f"{path.relative_to(ROOT)} cites ({number})" for path in files for number in _cited(path.read_text()) - defined
    ]
    assert not missing


def test_cited_references_exist():
    keys = set(re.findall(r"^@\w+\{(\w+),", (ROOT / "docs/references.bib").read_text(), re.M))
    missing = [
        f"{path.relative_to(ROOT)} cites [{name} {year}]"
        for path in SOURCES + PAGES
        for name, year in re.findall(r"\[([A-Z][A-Za-z]+)\s+(?://\s*)?(\d{4})[^\]]*\]", path.read_text())
        if name + year not in keys
    ]
    assert not missing


def test_cited_pages_exist():
    missing = []
    for path in SOURCES:
        for page in re.findall(r"docs/[\w/\-]+\.md", path.read_text()):
            if not (ROOT / page).is_file():
                missing.append(f"{path.relative_to(ROOT)} names {page}")
    for path in PAGES:
        for link in re.findall(r"\]\(([^)#]+)\)", path.read_text()):
            if "://" not in link and not (path.parent / link).exists():
                missing.append(f"{path.relative_to(ROOT)} links to {link}")
    assert not missing
