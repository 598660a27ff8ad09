"""Where problems come from: FCLIB files, folders of them, patterns, and generated families."""

from __future__ import annotations

import ast
import glob
import itertools
import os
import re
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stickslip import problems
from stickslip.contact import ContactProblem


@dataclass(frozen=True)
class Family:
    """So many generated problems."""

    text: str  #: as given: a name, and options behind commas
    name: str
    options: dict[str, Any]
    count: int
    seed: int  #: of the first problem


def family(text: str, count: int, seed: int) -> Family:
    """Reads "box_stack" or "box_stack,mass_ratio=1e4,heavy=top". ValueError for what `stickslip.problems` cannot make."""
    name, *settings = re.split(r",(?![^(]*\))", text)  # a comma inside parentheses belongs to a value: push=(1,0)
    options: dict[str, Any] = {}
    for setting in settings:
        key, sign, value = setting.partition("=")
        if not sign or key in ("family", "count", "seed", *options):
            raise ValueError(f"{text!r}: {setting!r} is no option; after the name come options once each, ,NAME=VALUE")
        options[key] = _value(value)
    if count < 1:
        raise ValueError(f"count is {count}; it must be at least 1")
    result = Family(text, name, options, count, seed)
    try:
        next(problems.generate(name, 1, seed, **options))
        next(problems.generate(name, 1, seed + count - 1, **options))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{text!r}: {error}") from None
    return result


def generated(families: Iterable[Family]) -> Iterator[tuple[str, ContactProblem]]:
    """The problems of families, named by their seeds."""
    for f in families:
        seeds = itertools.count(f.seed)
        for seed, problem in zip(seeds, problems.generate(f.name, f.count, f.seed, **f.options), strict=False):
            yield f"{f.text} #{seed}", problem


def find_files(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Paths of the files that arguments mean, each once, and what is wrong with the other arguments.

    An argument is a file, a folder (all `*.hdf5` in it) or a pattern of *, ?, [...] and **.
    """
    found: list[str] = []
    complaints: list[str] = []
    for argument in arguments:
        if os.path.isdir(argument):
            inside = sorted(str(path) for path in Path(argument).glob("*.hdf5"))
            if not inside:
                complaints.append(f"{argument}: there is no *.hdf5 file in this folder")
            found += inside
        elif not os.path.lexists(argument) and glob.has_magic(argument):
            inside = sorted(path for path in glob.glob(argument, recursive=True) if os.path.isfile(path))
            if not inside:
                complaints.append(f"{argument}: no file matches this pattern")
            found += inside
        else:
            found.append(argument)
    once = {os.path.realpath(path): path for path in reversed(found)}
    first = set(once.values())
    return [path for path in dict.fromkeys(found) if path in first], complaints


def loaded(paths: Iterable[str], errors: list[str], notes: list[str]) -> Iterator[tuple[str, ContactProblem]]:
    """The problems of files. Why a file could not be read is added to errors, what was odd about another one to notes."""
    from stickslip import fclib

    for path in paths:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                problem = fclib.load(path)
            except (OSError, ValueError, MemoryError) as error:
                errors.append(_said(path, error))
                continue
        notes += [printable(str(w.message)) for w in caught]
        yield printable(path), problem


def distinct(pairs: Iterable[tuple[str, ContactProblem]]) -> Iterator[tuple[str, ContactProblem]]:
    """With a number behind a name that was there before."""
    seen: Counter[str] = Counter()
    for name, problem in pairs:
        seen[name] += 1
        yield (name if seen[name] == 1 else f"{name} ({seen[name]})"), problem


def printable(text: str) -> str:
    """Without the bytes of a file name that are no text, and without control characters."""
    text = os.fsencode(text).decode("utf-8", "backslashreplace")
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def _said(path: str, error: Exception) -> str:
    reason = str(error) or type(error).__name__
    return printable(reason if reason.startswith(path) else f"{path}: {reason}")


def _value(text: str) -> Any:
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return text  # a word: heavy=top
