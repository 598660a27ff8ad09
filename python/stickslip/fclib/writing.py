"""From a problem to an FCLIB file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import h5py
import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from stickslip._planar import planar_rows
from stickslip.contact import ContactProblem, ContactSolution
from stickslip.fclib.hdf5 import path_of
from stickslip.fclib.order import our_rows
from stickslip.fclib.problems import GlobalProblem, LocalProblem, Solution

Storage = Literal["csr", "csc", "triplet"]

_STORAGES = ("csr", "csc", "triplet")


def write(
    path: str | os.PathLike[str],
    problem: LocalProblem | GlobalProblem,
    *,
    storage: Storage = "csr",
    title: str | None = None,
    description: str | None = None,
    math_info: str | None = None,
    solution: Solution | None = None,
    guesses: Sequence[Solution] | None = None,
) -> None:
    """Writes an FCLIB file; a file that is there is replaced once the new one is complete.

    storage: form of the matrices. What is None is taken from `problem`.

    FileNotFoundError for a folder that is not there, OSError where the file cannot be written, ValueError for what does not fit.
    """
    if storage not in _STORAGES:
        raise ValueError(f"storage is {storage!r}; choose one of {', '.join(map(repr, _STORAGES))}")
    if not isinstance(problem, (LocalProblem, GlobalProblem)):
        raise TypeError(
            f"problem is a {type(problem).__name__}; a LocalProblem or GlobalProblem is wanted (or use save)"
        )
    given = {
        "title": title,
        "description": description,
        "math_info": math_info,
        "solution": solution,
        "guesses": guesses,
    }
    problem = replace(problem, **{name: value for name, value in given.items() if value is not None})
    target = path_of(path)
    folder = os.path.dirname(target) or "."
    if not os.path.isdir(folder):
        raise FileNotFoundError(f"{target}: the folder {folder} does not exist")
    if os.path.isdir(target):
        raise IsADirectoryError(f"{target}: is a folder; give the path of a file")
    partial = f"{target}.{os.getpid()}.partial"
    try:
        with h5py.File(partial, "w") as file:
            _write(file, problem, storage)
        os.replace(partial, target)
    except OSError as error:
        raise OSError(f"{target}: cannot be written ({' '.join(str(error).split())})") from None
    finally:
        if os.path.exists(partial):
            os.remove(partial)


def save(
    path: str | os.PathLike[str],
    problem: ContactProblem,
    *,
    storage: Storage = "csr",
    title: str = "",
    description: str = "",
    math_info: str = "",
    solution: ContactSolution | None = None,
    spacedim: int | None = None,
) -> None:
    """Writes a `ContactProblem`, and a solution of it, as a local problem.

    spacedim: 2 for a problem in the plane x, z (ValueError if it is not in that plane); None: `problem.dimension`. Errors: see
    `write`.
    """
    if not isinstance(problem, ContactProblem):
        raise TypeError(f"problem is a {type(problem).__name__}; a ContactProblem is wanted (or use write)")
    if spacedim is None:
        spacedim = problem.dimension
    local = LocalProblem.from_contact_problem(problem, spacedim=spacedim)
    stored = None
    if solution is not None:
        stored = Solution.from_contact_solution(solution)
        if spacedim == 2:  # impulses along y do nothing there
            rows = planar_rows(problem.num_contacts)
            stored = Solution(u=stored.u[rows], r=stored.r[rows])
    write(path, local, storage=storage, title=title, description=description, math_info=math_info, solution=stored)


def _write(file: h5py.File, problem: LocalProblem | GlobalProblem, storage: Storage) -> None:
    main = file.create_group("fclib_local" if isinstance(problem, LocalProblem) else "fclib_global")
    _integer(main, "spacedim", problem.spacedim)
    order = our_rows(problem.spacedim * len(problem.mu), problem.spacedim)
    if isinstance(problem, LocalProblem):
        matrices = {"W": (problem.W, order, order), "V": (problem.V, order, None), "R": (problem.R, None, None)}
        vectors = {"q": problem.q[order], "mu": problem.mu, "s": problem.s}
    else:
        matrices = {"M": (problem.M, None, None), "H": (problem.H, None, order), "G": (problem.G, None, None)}
        vectors = {"f": problem.f, "w": problem.w[order], "mu": problem.mu, "b": problem.b}
    for name, (matrix, row_order, column_order) in matrices.items():
        if matrix is not None:
            _matrix(main.create_group(name), matrix, row_order, column_order, storage)
    group = main.create_group("vectors")
    for name, values in vectors.items():
        if values is not None:
            _reals(group, name, values)
    texts = {name: getattr(problem, name) for name in ("title", "description", "math_info") if getattr(problem, name)}
    if texts:
        info = main.create_group("info")
        for name, text in texts.items():
            _text(info, name, text)
    if problem.solution is not None:
        _solution(file.create_group("solution"), problem.solution, order)
    if problem.guesses:
        guesses = file.create_group("guesses")
        _integer(guesses, "number_of_guesses", len(problem.guesses))
        for k, guess in enumerate(problem.guesses):
            _solution(guesses.create_group(str(k + 1)), guess, order)


def _matrix(
    group: h5py.Group,
    matrix: sp.csr_array,
    row_order: NDArray[np.int64] | None,
    column_order: NDArray[np.int64] | None,
    storage: Storage,
) -> None:
    theirs = matrix if row_order is None else matrix[row_order]
    theirs = theirs if column_order is None else theirs[:, column_order]
    theirs = sp.csr_array(theirs)
    theirs.eliminate_zeros()
    if theirs.nnz > np.iinfo(np.int32).max:
        raise ValueError(f"{group.name} has {theirs.nnz} entries; FCLIB counts in 32 bits")
    if storage == "triplet":
        entries = theirs.tocoo()
        nz, p, i, x = entries.nnz, entries.col, entries.row, entries.data  # as CSparse, see reading
    else:
        compressed = theirs if storage == "csr" else theirs.tocsc()
        compressed.sort_indices()
        nz, p, i, x = -2 if storage == "csr" else -1, compressed.indptr, compressed.indices, compressed.data
    for name, value in (("nzmax", theirs.nnz), ("m", theirs.shape[0]), ("n", theirs.shape[1]), ("nz", nz)):
        _integer(group, name, value)
    group.create_dataset("p", data=np.asarray(p, dtype=np.int32))
    group.create_dataset("i", data=np.asarray(i, dtype=np.int32))
    _reals(group, "x", x)


def _solution(group: h5py.Group, solution: Solution, order: NDArray[np.int64]) -> None:
    for name in ("v", "l", "u", "r"):
        values = getattr(solution, name)
        if values is not None:
            _reals(group, name, np.asarray(values)[order] if name in "ur" else values)


def _integer(group: h5py.Group, name: str, value: int) -> None:
    group.create_dataset(name, data=np.array([value], dtype=np.int32))


def _reals(group: h5py.Group, name: str, values: ArrayLike) -> None:
    group.create_dataset(name, data=np.asarray(values, dtype=np.float64))


def _text(group: h5py.Group, name: str, text: str) -> None:
    """A string of fixed length that ends in a zero, as FCLIB's C code wants to read it; h5py would not write that zero."""
    data = text.encode("utf-8", errors="replace") + b"\0"
    if b"\0" in data[:-1]:
        raise ValueError(f"{name} has a zero character; FCLIB's texts end there")
    kind = h5py.h5t.C_S1.copy()
    kind.set_size(len(data))
    kind.set_strpad(h5py.h5t.STR_NULLTERM)
    kind.set_cset(h5py.h5t.CSET_UTF8)
    space = h5py.h5s.create(h5py.h5s.SCALAR)
    timeless = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    timeless.set_obj_track_times(False)  # the same problem gives the same file, as h5py sees to elsewhere
    dataset = h5py.h5d.create(group.id, name.encode(), kind, space, dcpl=timeless)
    dataset.write(space, space, np.array(data, dtype=f"S{len(data)}"), kind)
