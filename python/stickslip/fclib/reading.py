"""From an FCLIB file to a problem."""

from __future__ import annotations

import os
import warnings
from typing import Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from stickslip.contact import ContactProblem
from stickslip.fclib.hdf5 import Group, opened, path_of
from stickslip.fclib.order import our_rows
from stickslip.fclib.problems import GlobalProblem, LocalProblem, Solution

Form = Literal["local", "global"]


def read(path: str | os.PathLike[str], form: Form | None = None) -> LocalProblem | GlobalProblem:
    """What an FCLIB file holds, in our order.

    form: "local" or "global", for a file that holds both.

    FileNotFoundError, OSError for a file that cannot be read, ValueError for everything in it that is not as it should be; they name
    the file and the group or data set. A solution or guess with a data set that was never written is left out; a UserWarning names it.
    """
    unwritten: list[str] = []
    problem = _read(path, form, unwritten)
    for says in unwritten:
        warnings.warn(says, UserWarning, stacklevel=2)
    return problem


def load(path: str | os.PathLike[str], form: Form | None = None) -> ContactProblem:
    """The `ContactProblem` of an FCLIB file; its solution and guesses are not looked at. Errors: see `read`, `to_contact_problem`."""
    return _read(path, form, None).to_contact_problem()


def _read(path: str | os.PathLike[str], form: Form | None, unwritten: list[str] | None) -> LocalProblem | GlobalProblem:
    """Without solutions if `unwritten` is None; else it gets a text for each that is left out."""
    if form not in (None, "local", "global"):
        raise ValueError(f"form is {form!r}; it must be 'local', 'global' or None")
    name = path_of(path)
    with opened(name) as root:
        found = _form(root, form)
        main = root.group(f"fclib_{found}")
        spacedim = _spacedim(main)
        fields = _local(main, spacedim) if found == "local" else _global(main, spacedim)
        fields |= _texts(main)
        if unwritten is not None:
            fields |= _solutions(root, fields, spacedim, unwritten)
    kind = LocalProblem if found == "local" else GlobalProblem
    return kind(spacedim=spacedim, source=name, **fields)


def _form(root: Group, form: Form | None) -> Form:
    names = root.names()
    there = [known for known in ("local", "global") if f"fclib_{known}" in names]
    rolling = [other for other in names if other.startswith("fclib_") and other.endswith("_rolling")]
    if form is not None and form in there:
        return form
    if form is None and len(there) == 1:
        return there[0]
    if form is None and there:
        raise root.error("", "holds fclib_local and fclib_global; say which one with form='local' or form='global'")
    if rolling and not there:
        raise root.error(rolling[0], "is a problem with rolling friction, which is not supported")
    wanted = "fclib_local or fclib_global" if form is None else f"fclib_{form}"
    raise root.error("", f"has no group {wanted}; there is {', '.join(names[:20]) or 'nothing'} in it")


def _spacedim(main: Group) -> int:
    spacedim = main.integer("spacedim")
    if spacedim == 5:
        raise main.error("spacedim", "is 5: a problem with rolling friction, which is not supported")
    if spacedim not in (2, 3):
        raise main.error("spacedim", f"is {spacedim}; 2 or 3 is expected")
    return spacedim


def _contacts(vectors: Group, name: str, spacedim: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """q or w, in FCLIB's order, and mu."""
    values = vectors.reals(name)
    if len(values) % spacedim:
        raise vectors.error(name, f"has {len(values)} entries; a multiple of spacedim = {spacedim} is expected")
    n = len(values) // spacedim
    mu = vectors.reals("mu", n, f"one per contact, {name} has {len(values)} entries", infinite=True)
    if len(mu) and mu.min() < 0:
        k = int(np.argmax(mu < 0))
        raise vectors.error(f"mu[{k}]", f"is {mu[k]}; it must be zero or positive")
    return values, mu


def _local(main: Group, spacedim: int) -> dict:
    vectors = main.group("vectors")
    q, mu = _contacts(vectors, "q", spacedim)
    order = our_rows(len(q), spacedim)
    sizes = f"vectors/q has {len(q)} entries"
    fields = {"q": _ours(q, order), "mu": mu}
    fields["W"] = _matrix(main.group("W"), (len(q), len(q)), sizes, order, order)
    if "V" in main or "R" in main:
        s = vectors.reals("s")
        sizes += f", vectors/s {len(s)}"
        fields["V"] = _matrix(main.group("V"), (len(q), len(s)), sizes, order, None)
        fields["R"] = _matrix(main.group("R"), (len(s), len(s)), sizes, None, None)
        fields["s"] = s
    return fields


def _global(main: Group, spacedim: int) -> dict:
    vectors = main.group("vectors")
    w, mu = _contacts(vectors, "w", spacedim)
    f = vectors.reals("f")
    order = our_rows(len(w), spacedim)
    sizes = f"vectors/f has {len(f)} entries, vectors/w {len(w)}"
    fields = {"f": f, "w": _ours(w, order), "mu": mu}
    fields["M"] = _matrix(main.group("M"), (len(f), len(f)), sizes, None, None)
    fields["H"] = _matrix(main.group("H"), (len(f), len(w)), sizes, None, order)
    if "G" in main:
        b = vectors.reals("b")
        fields["G"] = _matrix(main.group("G"), (len(f), len(b)), f"{sizes}, vectors/b {len(b)}", None, None)
        fields["b"] = b
    return fields


def _ours(values: NDArray[np.float64], order: NDArray[np.int64]) -> NDArray[np.float64]:
    result = np.empty_like(values)
    result[order] = values
    return result


def _matrix(
    group: Group,
    shape: tuple[int, int],
    why: str,
    row_order: NDArray[np.int64] | None,
    column_order: NDArray[np.int64] | None,
) -> sp.csr_array:
    """A matrix in any of the three forms, rows and columns in our order. The shape is known from the vectors."""
    m, n, nz, nzmax = (group.integer(name) for name in ("m", "n", "nz", "nzmax"))
    for name, value, expected in (("m", m, shape[0]), ("n", n, shape[1])):
        if value != expected:
            raise group.error(name, f"is {value}; {expected} is expected ({why})")
    if nz < -2:
        raise group.error("nz", f"is {nz}; -2 (rows), -1 (columns) or a number of triplets is expected")
    if nzmax < max(nz, 0):
        raise group.error("nzmax", f"is {nzmax}; at least {max(nz, 0)} is expected")
    if nz >= 0:
        rows, columns, values = _triplets(group, shape, nz)
    else:
        pointers, others = ("row", "column") if nz == -2 else ("column", "row")
        size, bound = (m, n) if nz == -2 else (n, m)
        by, along, values = _compressed(group, size, bound, nzmax, pointers, others)
        rows, columns = (by, along) if nz == -2 else (along, by)
    if row_order is not None:
        rows = row_order[rows]
    if column_order is not None:
        columns = column_order[columns]
    with np.errstate(over="ignore"):
        result = sp.csr_array(sp.coo_array((values, (rows, columns)), shape=shape))  # repeated entries add up
    if not np.isfinite(result.data).all():
        raise group.error("x", "overflows where repeated entries add up")
    return result


def _triplets(group: Group, shape: tuple[int, int], nz: int) -> tuple:
    """Row, column and value of each entry.

    FCLIB's header calls p the rows and i the columns; its own arithmetic and every program that writes such files take CSparse's
    meaning, i rows and p columns. So do we, unless only the header's fits into the shape.
    """
    i, p = (group.integers(name, nz, f"nz = {nz}") for name in ("i", "p"))
    x = group.reals("x", nz, f"nz = {nz}")
    if not (_within(i, shape[0]) and _within(p, shape[1])) and _within(p, shape[0]) and _within(i, shape[1]):
        return p, i, x
    _check_range(group, "i", i, shape[0], "row")
    _check_range(group, "p", p, shape[1], "column")
    return i, p, x


def _compressed(group: Group, size: int, bound: int, nzmax: int, pointers: str, others: str) -> tuple:
    """Index of the compressed direction, of the other one, and value of each entry."""
    p = group.integers("p", size + 1, f"one more than the {size} {pointers}s")
    if p[0] != 0:
        raise group.error("p[0]", f"is {p[0]}; 0 is expected")
    falls = np.flatnonzero(p[1:] < p[:-1])
    if len(falls):
        k = int(falls[0]) + 1
        raise group.error(
            f"p[{k}]", f"is {p[k]}, less than p[{k - 1}] = {p[k - 1]}; {pointers} pointers never decrease"
        )
    if p[-1] > nzmax:
        raise group.error(f"p[{size}]", f"is {p[-1]}; at most nzmax = {nzmax} is expected")
    i = group.integers("i", nzmax, f"nzmax = {nzmax}")[: p[-1]]
    x = group.reals("x", nzmax, f"nzmax = {nzmax}")[: p[-1]]
    _check_range(group, "i", i, bound, others)
    return np.repeat(np.arange(size), np.diff(p)), i, x


def _within(index: NDArray[np.int64], size: int) -> bool:
    return bool(np.all((index >= 0) & (index < size)))


def _check_range(group: Group, name: str, index: NDArray[np.int64], size: int, what: str) -> None:
    bad = np.flatnonzero((index < 0) | (index >= size))
    if len(bad):
        k = int(bad[0])
        raise group.error(f"{name}[{k}]", f"is {index[k]}; a {what} from 0 to {size - 1} is expected")


def _texts(main: Group) -> dict[str, str]:
    if "info" not in main:
        return {}
    info = main.group("info")
    return {name: info.text(name) for name in ("title", "description", "math_info") if name in info}


def _solutions(root: Group, fields: dict, spacedim: int, unwritten: list[str]) -> dict:
    """`solution` and `guesses`, which lie beside the problem's group."""
    contacts = len(fields["mu"]) * spacedim
    sizes = {"u": contacts, "r": contacts}
    if "f" in fields:
        sizes["v"] = len(fields["f"])
    multipliers = fields.get("s", fields.get("b"))
    if multipliers is not None:
        sizes["l"] = len(multipliers)
    order = our_rows(contacts, spacedim)
    result: dict = {}
    if "solution" in root:
        result["solution"] = _solution(root.group("solution"), sizes, order, unwritten)
    if "guesses" in root:
        guesses = root.group("guesses")
        number = guesses.integer("number_of_guesses")
        if number < 0:
            raise guesses.error("number_of_guesses", f"is {number}; it must be zero or positive")
        # One by one, so that a number that is only claimed ends at the first group that is missing.
        found = (_solution(guesses.group(str(k + 1)), sizes, order, unwritten) for k in range(number))
        result["guesses"] = [guess for guess in found if guess is not None]
    return result


def _solution(group: Group, sizes: dict[str, int], order: NDArray[np.int64], unwritten: list[str]) -> Solution | None:
    """None, with a text in `unwritten`, where a program made a data set and never filled it: its fill values are no solution."""
    values = {
        name: group.reals_if_written(name, size, "as the problem has unknowns")
        for name, size in sizes.items()
        if size or name in "ur"
    }
    lost = [name for name, value in values.items() if value is None]
    if lost:
        unwritten.append(str(group.error(lost[0], "was never written, only made; this solution or guess is left out")))
        return None
    for name in ("u", "r"):
        values[name] = _ours(values[name], order)
    return Solution(**values)
