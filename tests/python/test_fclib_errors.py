"""FCLIB files and problems that are not as they should be: each is refused by name."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp

import stickslip as ss
from fclib_problems import global_problem, local_problem
from stickslip import fclib

# Errors of files


def broken(path: Path, change: Callable[[h5py.File], None], problem: object = None, storage: str = "csr") -> str:
    """What reading a changed file says."""
    fclib.write(path, problem or local_problem(), storage=storage)
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(ValueError) as error:
        fclib.read(path)
    assert type(error.value) is ValueError
    text = str(error.value)
    assert text.startswith(f"{path}: ")
    return text.removeprefix(f"{path}: ")


def put(name: str, value: object) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        if name in file:
            del file[name]
        file[name] = value

    return change


def entry(name: str, index: int, value: float) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        file[name][index] = value

    return change


def remove(name: str) -> Callable[[h5py.File], None]:
    return lambda file: file.__delitem__(name)


def as_group(name: str) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file[name]
        file.create_group(name)

    return change


def linked(name: str, link: object) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file[name]
        file[name] = link

    return change


def claimed(name: str, shape: tuple[int, ...], dtype: str, **options: object) -> Callable[[h5py.File], None]:
    """A data set that says it is large and holds nothing."""

    def change(file: h5py.File) -> None:
        del file[name]
        file.create_dataset(name, shape=shape, dtype=dtype, **options)

    return change


L = "fclib_local/"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (remove("fclib_local"), "has no group fclib_local or fclib_global; there is guesses, solution in it"),
        (put("fclib_local", 3), "fclib_local is a data set; a group is expected"),
        (remove(L + "W"), "fclib_local/W is missing; there is info, spacedim, vectors in fclib_local"),
        (put(L + "W", [1.0]), "fclib_local/W is a data set; a group is expected"),
        (put(L + "W", np.dtype("f8")), "fclib_local/W is a named type; a group is expected"),
        (remove(L + "vectors/q"), "fclib_local/vectors/q is missing; there is mu in fclib_local/vectors"),
        (as_group(L + "vectors/q"), "fclib_local/vectors/q is a group; a data set with real numbers is expected"),
        (put(L + "spacedim", [4]), "fclib_local/spacedim is 4; 2 or 3 is expected"),
        (
            put(L + "spacedim", [5]),
            "fclib_local/spacedim is 5: a problem with rolling friction, which is not supported",
        ),
        (put(L + "spacedim", [3.0]), "fclib_local/spacedim has type float64; an integer expected"),
        (put(L + "spacedim", [3, 3]), "fclib_local/spacedim has shape (2,); a single integer is expected"),
        (put(L + "spacedim", h5py.Empty("i4")), "fclib_local/spacedim has no value; an integer expected"),
        (put(L + "W/m", [9]), "fclib_local/W/m is 9; 12 is expected (vectors/q has 12 entries)"),
        (put(L + "W/n", [-12]), "fclib_local/W/n is -12; 12 is expected (vectors/q has 12 entries)"),
        (put(L + "W/m", [2**31 - 1]), "fclib_local/W/m is 2147483647; 12 is expected"),
        (put(L + "W/nz", [-3]), "fclib_local/W/nz is -3; -2 (rows), -1 (columns) or a number of triplets is expected"),
        (put(L + "W/nz", [2**40]), "fclib_local/W/nzmax is "),
        (put(L + "W/nzmax", [-1]), "fclib_local/W/nzmax is -1; at least 0 is expected"),
        (
            put(L + "W/nzmax", [2**31 - 1]),
            "entries; 2147483647 are expected (nzmax = 2147483647)",
        ),
        (put(L + "W/p", np.arange(12)), "fclib_local/W/p has 12 entries; 13 are expected (one more than the 12 rows)"),
        (put(L + "W/p", np.zeros(13)), "fclib_local/W/p has type float64; integers expected"),
        (put(L + "W/p", [[0] * 13]), "fclib_local/W/p has shape (1, 13); one dimension is expected"),
        (entry(L + "W/p", 0, 1), "fclib_local/W/p[0] is 1; 0 is expected"),
        (entry(L + "W/p", 5, 0), "fclib_local/W/p[5] is 0, less than p[4] = "),
        (entry(L + "W/p", 12, 999), "fclib_local/W/p[12] is 999; at most nzmax = "),
        (entry(L + "W/i", 3, 12), "fclib_local/W/i[3] is 12; a column from 0 to 11 is expected"),
        (entry(L + "W/i", 3, -1), "fclib_local/W/i[3] is -1; a column from 0 to 11 is expected"),
        (put(L + "W/i", [0, 1]), "fclib_local/W/i has 2 entries; "),
        (put(L + "W/x", [1.0]), "fclib_local/W/x has 1 entries; "),
        (entry(L + "W/x", 7, np.nan), "fclib_local/W/x[7] is nan; it must be finite"),
        (put(L + "vectors/q", ["a"] * 12), "fclib_local/vectors/q has type object; real numbers expected"),
        (
            put(L + "vectors/q", np.zeros(12, complex)),
            "fclib_local/vectors/q has type complex128; real numbers expected",
        ),
        (put(L + "vectors/q", np.zeros((3, 4))), "fclib_local/vectors/q has shape (3, 4); one dimension is expected"),
        (put(L + "vectors/q", np.zeros(11)), "fclib_local/vectors/q has 11 entries; a multiple of spacedim = 3"),
        (
            put(L + "vectors/q", np.zeros(9)),
            "fclib_local/vectors/mu has 4 entries; 3 are expected (one per contact, q has 9",
        ),
        (entry(L + "vectors/q", 2, np.inf), "fclib_local/vectors/q[2] is inf; it must be finite"),
        (entry(L + "vectors/mu", 1, -0.5), "fclib_local/vectors/mu[1] is -0.5; it must be zero or positive"),
        (entry(L + "vectors/mu", 1, np.nan), "fclib_local/vectors/mu[1] is nan; it must be finite"),
        (put(L + "V/m", [12]), "fclib_local/vectors/s is missing"),
        (put(L + "info", 1), "fclib_local/info is a data set; a group is expected"),
        (put(L + "info/title", 1), "fclib_local/info/title has type int64; a text expected"),
        (put(L + "info/title", ["a", "b"]), "fclib_local/info/title has shape (2,); a single text is expected"),
        (remove("solution/r"), "solution/r is missing; there is u in solution"),
        (put("solution/u", np.zeros(3)), "solution/u has 3 entries; 12 are expected (as the problem has unknowns)"),
        (put("guesses/number_of_guesses", [-1]), "guesses/number_of_guesses is -1; it must be zero or positive"),
        (put("guesses/number_of_guesses", [2**31 - 1]), "guesses/3 is missing"),
        (linked(L + "W", h5py.SoftLink("/nowhere")), "fclib_local/W is a link to nothing"),
        (linked(L + "W", h5py.ExternalLink("b.hdf5", "/W")), "fclib_local/W is a link to another file"),
        (
            claimed(L + "vectors/q", (3 * 10**12,), "f8", chunks=(1000,)),
            "fclib_local/vectors/q claims 24000000000000 bytes",
        ),
        (
            claimed(L + "vectors/mu", (4,), "f8"),
            "fclib_local/vectors/mu claims 32 bytes, but was never written in full",
        ),
        (claimed(L + "W/x", (10**9,), "f8"), "fclib_local/W/x has 1000000000 entries; "),
        (
            claimed(L + "vectors/q", (12,), "f8", external="/dev/zero"),
            "fclib_local/vectors/q has its values in other files",
        ),
    ],
)
def test_what_is_wrong_in_a_file_is_named(tmp_path: Path, change: Callable[[h5py.File], None], says: str) -> None:
    assert says in broken(tmp_path / "broken.hdf5", change)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (entry(L + "W/i", 0, 12), "fclib_local/W/i[0] is 12; a row from 0 to 11 is expected"),
        (entry(L + "W/p", 0, -1), "fclib_local/W/p[0] is -1; a column from 0 to 11 is expected"),
        (put(L + "W/nz", [3]), "fclib_local/W/i has "),
        (put(L + "W/nzmax", [3]), "fclib_local/W/nzmax is 3; at least "),
        (put(L + "W/x", [1.0]), "fclib_local/W/x has 1 entries; "),
    ],
)
def test_what_is_wrong_in_triplets_is_named(tmp_path: Path, change: Callable[[h5py.File], None], says: str) -> None:
    assert says in broken(tmp_path / "broken.hdf5", change, storage="triplet")


G = "fclib_global/"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (put(G + "M/m", [6]), "fclib_global/M/m is 6; 7 is expected (vectors/f has 7 entries, vectors/w 9)"),
        (put(G + "H/n", [7]), "fclib_global/H/n is 7; 9 is expected"),
        (
            put(G + "G/n", [3]),
            "fclib_global/G/n is 3; 2 is expected (vectors/f has 7 entries, vectors/w 9, vectors/b 2)",
        ),
        (remove(G + "H"), "fclib_global/H is missing; there is G, M, info, spacedim, vectors in fclib_global"),
        (remove(G + "vectors/f"), "fclib_global/vectors/f is missing"),
        (remove(G + "vectors/b"), "fclib_global/vectors/b is missing"),
        (entry(G + "vectors/f", 6, -np.inf), "fclib_global/vectors/f[6] is -inf; it must be finite"),
        (entry(G + "H/x", 0, np.nan), "fclib_global/H/x[0] is nan; it must be finite"),
        (put("solution/v", [1.0]), "solution/v has 1 entries; 7 are expected"),
        (remove("guesses/1/l"), "guesses/1/l is missing"),
        (
            lambda f: f.move("fclib_global", "fclib_global_rolling"),
            "fclib_global_rolling is a problem with rolling friction",
        ),
    ],
)
def test_what_is_wrong_in_a_global_problem_is_named(tmp_path: Path, change: Callable, says: str) -> None:
    assert says in broken(tmp_path / "broken.hdf5", change, global_problem(constraints=2))


def test_a_link_that_leads_to_another_file_by_a_detour_is_refused(tmp_path: Path) -> None:
    fclib.write(tmp_path / "other.hdf5", local_problem())

    def detour(file: h5py.File) -> None:
        file["away"] = h5py.ExternalLink("other.hdf5", "/fclib_local")
        del file["fclib_local/W"]
        file["fclib_local/W"] = h5py.SoftLink("/away/W")

    assert "fclib_local/W is a link to another file" in broken(tmp_path / "a.hdf5", detour)


def test_links_within_a_file_are_followed(tmp_path: Path) -> None:
    fclib.write(tmp_path / "a.hdf5", local_problem())
    with h5py.File(tmp_path / "a.hdf5", "r+") as file:
        file.move("fclib_local/W", "elsewhere")
        file["fclib_local/W"] = h5py.SoftLink("/elsewhere")
    assert fclib.load(tmp_path / "a.hdf5").num_contacts == 4


def test_sums_that_overflow_are_refused(tmp_path: Path) -> None:
    problem = fclib.LocalProblem(np.diag([1e308, 1, 1]), np.zeros(3), [0.5])

    def twice(file: h5py.File) -> None:
        for name, value in (("i", [0, 0]), ("p", [0, 0]), ("x", [1e308, 1e308]), ("nz", [2]), ("nzmax", [2])):
            put(L + "W/" + name, value)(file)

    text = broken(tmp_path / "a.hdf5", twice, problem)
    assert text == "fclib_local/W/x overflows where repeated entries add up"


def test_what_is_no_problem_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nothing.hdf5: there is no such file"):
        fclib.load(tmp_path / "nothing.hdf5")
    with pytest.raises(OSError, match="is not a file but a folder"):
        fclib.load(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="pipe: is not a file but a device"):
        fclib.load(tmp_path / "pipe")
    for content in (b"", b"problem", b"\x89HDF\r\n"):
        (tmp_path / "text.hdf5").write_bytes(content)
        with pytest.raises(ValueError, match="text.hdf5: is not an HDF5 file"):
            fclib.load(tmp_path / "text.hdf5")
    with pytest.raises(TypeError, match="path is a int"):
        fclib.load(3)
    with h5py.File(tmp_path / "empty.hdf5", "w"):
        pass
    with pytest.raises(ValueError, match="has no group fclib_local or fclib_global; there is nothing in it"):
        fclib.load(tmp_path / "empty.hdf5")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_file_that_may_not_be_read_is_named(tmp_path: Path) -> None:
    fclib.write(tmp_path / "a.hdf5", local_problem())
    (tmp_path / "a.hdf5").chmod(0)
    with pytest.raises(OSError, match="a.hdf5: cannot be read"):
        fclib.load(tmp_path / "a.hdf5")


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.999])
def test_a_file_cut_short_is_refused(tmp_path: Path, share: float) -> None:
    fclib.write(tmp_path / "a.hdf5", local_problem())
    data = (tmp_path / "a.hdf5").read_bytes()
    (tmp_path / "a.hdf5").write_bytes(data[: int(share * len(data))])
    with pytest.raises(ValueError, match="a.hdf5: is a damaged HDF5 file"):
        fclib.load(tmp_path / "a.hdf5")


def test_loading_does_not_look_at_solutions(tmp_path: Path) -> None:
    broken(tmp_path / "a.hdf5", entry("solution/u", 0, np.nan))
    assert fclib.load(tmp_path / "a.hdf5").num_contacts == 4


@pytest.mark.parametrize(
    ("name", "kept"),
    [("solution/r", (False, 2)), ("solution/v", (False, 2)), ("guesses/1/l", (True, 1)), ("guesses/2/u", (True, 1))],
)
def test_solutions_that_were_never_written_are_left_out_and_told(
    tmp_path: Path, name: str, kept: tuple[bool, int]
) -> None:
    """Some programs make the data sets before they have something to put into them."""
    path = tmp_path / "a.hdf5"
    original = replace(
        global_problem(constraints=2), guesses=[global_problem(constraints=2, seed=k).solution for k in (1, 2)]
    )
    fclib.write(path, original)
    with h5py.File(path, "r+") as file:
        claimed(name, file[name].shape, "f8")(file)
    with pytest.warns(UserWarning) as caught:
        problem = fclib.read(path)
    assert [str(w.message) for w in caught] == [
        f"{path}: {name} was never written, only made; this solution or guess is left out"
    ]
    assert caught[0].filename == __file__
    assert (problem.solution is not None, len(problem.guesses)) == kept
    if name == "guesses/1/l":
        np.testing.assert_array_equal(problem.guesses[0].r, original.guesses[1].r)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert fclib.load(path).num_contacts == 3


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (claimed("solution/r", (10**12,), "f8"), "solution/r has 1000000000000 entries; 12 are expected"),
        (claimed("guesses/1/u", (11,), "f8"), "guesses/1/u has 11 entries; 12 are expected"),
        (claimed("solution/u", (12,), "i1", external="/dev/zero"), "solution/u has its values in other files"),
    ],
)
def test_solutions_that_only_claim_are_held_against_the_problem(tmp_path: Path, change: Callable, says: str) -> None:
    assert says in broken(tmp_path / "a.hdf5", change)


# Errors of arguments


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"W": np.eye(5)}, r"W has shape \(5, 5\); it must be \(6, 6\)"),
        ({"W": np.diag([1, 1, np.nan, 1, 1, 1])}, r"W\[2, 2\] is nan; it must be finite"),
        ({"W": [["a"] * 6] * 6}, "W: not a matrix of numbers"),
        ({"q": np.zeros(5)}, "q has 5 entries; 6 are expected, spacedim = 3 for each of 2 contacts"),
        ({"q": np.zeros((2, 3))}, r"q has shape \(2, 3\); it must have one dimension"),
        ({"q": [0, 0, np.inf, 0, 0, 0]}, r"q\[2\] is inf"),
        ({"mu": [0.5, -1]}, r"mu\[1\] is -1.0; it must be zero or positive"),
        ({"mu": [np.nan, 1]}, r"mu\[0\] is nan"),
        ({"mu": 0.5}, r"mu has shape \(\); it must be \(contacts,\)"),
        ({"spacedim": 5}, "spacedim is 5; it must be 2 or 3"),
        ({"V": np.zeros((6, 1))}, "V without the others; equality constraints are V, R and s together"),
        ({"V": np.zeros((5, 1)), "R": np.eye(1), "s": [0]}, r"V has shape \(5, 1\); it must be \(6, 1\)"),
        ({"V": np.zeros((6, 1)), "R": np.eye(2), "s": [0]}, r"R has shape \(2, 2\); it must be \(1, 1\)"),
        ({"solution": fclib.Solution(u=np.zeros(6), r=np.zeros(5))}, r"solution.r has shape \(5,\); it must be \(6,\)"),
        ({"solution": fclib.Solution(u=np.zeros(6), r=None)}, "solution.r is missing; 6 numbers are expected"),
        (
            {"guesses": [fclib.Solution(np.zeros(6), np.zeros(6), v=[1.0])]},
            r"guesses\[0\].v is given, but the problem has no",
        ),
    ],
)
def test_fields_that_do_not_fit_are_named(change: dict, says: str) -> None:
    fields = {"W": np.eye(6), "q": np.zeros(6), "mu": [0.5, 0.5]}
    fclib.LocalProblem(**fields)
    with pytest.raises(ValueError, match=says):
        fclib.LocalProblem(**(fields | change))


def test_fields_of_global_problems_that_do_not_fit_are_named() -> None:
    fields = {"M": np.eye(4), "H": np.zeros((4, 3)), "f": np.zeros(4), "w": np.zeros(3), "mu": [0.5]}
    fclib.GlobalProblem(**fields)
    for change, says in [
        ({"M": np.eye(3)}, "M has shape"),
        ({"H": np.zeros((3, 4))}, r"H has shape \(3, 4\); it must be \(4, 3\)"),
        ({"G": np.zeros((4, 1))}, "G and b are given together"),
        ({"G": np.zeros((3, 1)), "b": [1]}, r"G has shape \(3, 1\); it must be \(4, 1\)"),
    ]:
        with pytest.raises(ValueError, match=says):
            fclib.GlobalProblem(**(fields | change))


def test_what_cannot_be_written_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.hdf5"
    fclib.write(path, local_problem())
    before = path.read_bytes()
    for change, error, says in [
        ({"title": "a\0b"}, ValueError, "title has a zero character"),
        ({"storage": "dense"}, ValueError, "storage is 'dense'; choose one of 'csr', 'csc', 'triplet'"),
        ({"solution": 3}, TypeError, "solution is a int; a fclib.Solution is wanted"),
    ]:
        with pytest.raises(error, match=says):
            fclib.write(path, local_problem(), **change)
    assert [p.name for p in tmp_path.iterdir()] == ["a.hdf5"] and path.read_bytes() == before


def test_where_nothing_can_be_written_is_named(tmp_path: Path) -> None:
    problem = ss.ContactProblem(np.eye(3), np.zeros(3), [0.5])
    with pytest.raises(FileNotFoundError, match="a.hdf5: the folder .*nowhere does not exist"):
        fclib.save(tmp_path / "nowhere" / "a.hdf5", problem)
    with pytest.raises(OSError, match="is a folder"):
        fclib.save(tmp_path, problem)
    with pytest.raises(OSError, match=f"{'a' * 300}.*cannot be written"):
        fclib.save(tmp_path / ("a" * 300), problem)
    with pytest.raises(TypeError, match="problem is a LocalProblem; a ContactProblem is wanted"):
        fclib.save(tmp_path / "a.hdf5", local_problem())
    with pytest.raises(TypeError, match="problem is a ContactProblem; a LocalProblem or GlobalProblem is wanted"):
        fclib.write(tmp_path / "a.hdf5", problem)


def test_only_what_lies_in_the_plane_is_written_as_planar(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"delassus\[1, 1\] is 1.0; a problem in the plane"):
        fclib.save(tmp_path / "a.hdf5", ss.ContactProblem(np.eye(3), np.zeros(3), [0.5]), spacedim=2)
    with pytest.raises(ValueError, match=r"free_velocity\[1\] is 2.0; a problem in the plane"):
        fclib.save(tmp_path / "a.hdf5", ss.ContactProblem(np.diag([1.0, 0, 1]), [0, 2, 0], [0.5]), spacedim=2)
    with pytest.raises(ValueError, match="spacedim is 4"):
        fclib.save(tmp_path / "a.hdf5", ss.ContactProblem(np.eye(3), np.zeros(3), [0.5]), spacedim=4)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"delassus": np.eye(3)}, r"delassus has shape \(3, 3\); it must be \(4, 4\) for 2 contacts in the plane"),
        ({"delassus": sp.eye_array(6, format="csr")}, r"delassus has shape \(6, 6\); it must be \(4, 4\)"),
        ({"delassus": [[1, 2], [3]]}, "delassus: not an array of numbers"),
        ({"delassus": np.diag([1, 1, np.nan, 1])}, r"delassus\[2, 2\] is nan"),
        ({"free_velocity": np.zeros(6)}, r"free_velocity has shape \(6,\); it must be \(4,\) for 2 contacts"),
        ({"free_velocity": [0, 0, 0, np.inf]}, r"free_velocity\[3\] is inf"),
        ({"friction": 0.5}, r"friction has shape \(\); it must be \(n,\)"),
        ({"friction": ["a", "b"]}, "friction: not an array of numbers"),
    ],
)
def test_arguments_of_planar_problems_that_do_not_fit_are_named(change: dict, says: str) -> None:
    fields = {"delassus": np.eye(4), "free_velocity": np.zeros(4), "friction": [0.5, 0.5]}
    fclib.planar_to_spatial(**fields)
    with pytest.raises(ValueError, match=says):
        fclib.planar_to_spatial(**(fields | change))
