"""FCLIB files: round trips, the order of components, elimination of masses and constraints."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp

import stickslip as ss
from fclib_problems import delassus, global_problem, local_problem
from stickslip import fclib

STORAGES = ["csr", "csc", "triplet"]


def assert_equal(a: object, b: object) -> None:
    """Every field, to the bit."""
    if isinstance(a, (fclib.LocalProblem, fclib.GlobalProblem, fclib.Solution)):
        assert type(a) is type(b)
        for name in vars(a):
            if name != "source":
                assert_equal(getattr(a, name), getattr(b, name))
    elif isinstance(a, tuple):
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            assert_equal(x, y)
    elif sp.issparse(a):
        assert a.shape == b.shape
        np.testing.assert_array_equal(a.toarray(), b.toarray())
    elif isinstance(a, np.ndarray):
        np.testing.assert_array_equal(a, b)
    else:
        assert a == b


# Round trips


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize(
    "problem",
    [
        local_problem(),
        local_problem(spacedim=2),
        local_problem(constraints=3),
        local_problem(contacts=0),
        global_problem(),
        global_problem(spacedim=2),
        global_problem(constraints=2),
        global_problem(dofs=9, contacts=3),
    ],
    ids=["local", "planar", "constraints", "empty", "global", "global planar", "global constraints", "square H"],
)
def test_writing_and_reading_changes_no_bit(tmp_path: Path, problem: fclib.LocalProblem, storage: str) -> None:
    path = tmp_path / "problem.hdf5"
    fclib.write(path, problem, storage=storage)
    assert_equal(fclib.read(path), problem)
    with h5py.File(path) as file:
        matrix = file["fclib_local/W"] if "fclib_local" in file else file["fclib_global/M"]
        nz = {"csr": -2, "csc": -1, "triplet": len(matrix["x"])}[storage]
        assert matrix["nz"][:] == [nz] and matrix["p"].dtype == matrix["i"].dtype == np.int32


@pytest.mark.parametrize("storage", STORAGES)
def test_saving_and_loading_a_contact_problem_changes_no_bit(tmp_path: Path, storage: str) -> None:
    problem = ss.ContactProblem(delassus(12), np.arange(12.0) - 5, [0, 0.5, 1, np.inf])
    solution = ss.solve(problem)
    fclib.save(tmp_path / "p.hdf5", problem, storage=storage, title="Feet", solution=solution)
    again = fclib.load(tmp_path / "p.hdf5")
    np.testing.assert_array_equal(again.dense_delassus(), problem.delassus)
    np.testing.assert_array_equal(again.free_velocity, problem.free_velocity)
    np.testing.assert_array_equal(again.friction, problem.friction)
    stored = fclib.read(tmp_path / "p.hdf5")
    assert stored.title == "Feet" and stored.source == str(tmp_path / "p.hdf5") and stored.num_contacts == 4
    np.testing.assert_array_equal(stored.solution.r, solution.impulse)
    np.testing.assert_array_equal(stored.solution.u, solution.velocity)


@pytest.mark.parametrize("planar", [False, True])
def test_problems_load_and_save_themselves(tmp_path: Path, planar: bool) -> None:
    make = ss.ContactProblem.planar if planar else ss.ContactProblem
    rows = 4 if planar else 6
    problem = make(delassus(rows), np.arange(rows) - 2.5, [0.5, np.inf])
    solution = ss.solve(problem)
    problem.save(tmp_path / "p.hdf5", storage="triplet", title="Feet", solution=solution)
    again = ss.ContactProblem.load(tmp_path / "p.hdf5")
    assert type(again) is ss.ContactProblem and again.dimension == problem.dimension == (2 if planar else 3)
    np.testing.assert_array_equal(again.dense_delassus(), problem.dense_delassus())
    np.testing.assert_array_equal(again.free_velocity, problem.free_velocity)
    np.testing.assert_array_equal(again.friction, problem.friction)
    stored = fclib.read(tmp_path / "p.hdf5")
    assert stored.title == "Feet" and stored.spacedim == problem.dimension
    keep = np.arange(6) % 3 != 1 if planar else slice(None)
    np.testing.assert_array_equal(stored.solution.r, solution.impulse[keep])
    with h5py.File(tmp_path / "p.hdf5") as file:
        assert file["fclib_local/W/nz"][0] == len(file["fclib_local/W/x"]), "storage='triplet' was passed on"
    with pytest.raises(ValueError, match="storage is 'dense'"):
        problem.save(tmp_path / "p.hdf5", storage="dense")
    with pytest.raises(FileNotFoundError, match="nothing.hdf5"):
        ss.ContactProblem.load(tmp_path / "nothing.hdf5")


def test_a_problem_in_the_plane_stays_there(tmp_path: Path) -> None:
    planar = local_problem(spacedim=2)
    fclib.write(tmp_path / "a.hdf5", planar)
    problem = fclib.load(tmp_path / "a.hdf5")
    assert problem.num_contacts == 4
    G = problem.dense_delassus().copy()
    assert not G[1::3].any() and not G[:, 1::3].any() and not problem.free_velocity[1::3].any()
    keep = np.flatnonzero(np.arange(12) % 3 != 1)
    np.testing.assert_array_equal(G[np.ix_(keep, keep)], planar.W.toarray())
    np.testing.assert_array_equal(problem.free_velocity[keep], planar.q)

    solution = ss.solve(problem)
    assert solution.converged and not solution.velocity[1::3].any()
    fclib.save(tmp_path / "b.hdf5", problem, solution=solution)
    again = fclib.read(tmp_path / "b.hdf5")
    assert again.spacedim == 2
    np.testing.assert_array_equal(again.W.toarray(), planar.W.toarray())
    np.testing.assert_array_equal(again.solution.u, solution.velocity[keep])
    fclib.save(tmp_path / "c.hdf5", problem, spacedim=3)
    assert fclib.read(tmp_path / "c.hdf5").spacedim == 3


@pytest.mark.parametrize("form", [np.asarray, sp.csr_array, sp.coo_matrix])
def test_planar_to_spatial_and_back(form: Callable) -> None:
    W, q, mu = delassus(4), np.arange(4.0), np.array([0.3, 0.4])
    G, c, friction = fclib.planar_to_spatial(form(W), q, mu)
    assert sp.issparse(G) == sp.issparse(form(W)) and G.shape == (6, 6)
    np.testing.assert_array_equal(c, [0, 0, 1, 2, 0, 3])
    np.testing.assert_array_equal(friction, mu)
    W2, q2 = fclib.spatial_to_planar(G, c)
    np.testing.assert_array_equal(W2.toarray(), W)
    np.testing.assert_array_equal(q2, q)


def test_large_sparse_problems_load() -> None:
    n = 150
    blocks = sp.block_diag([delassus(3, k) for k in range(n)], format="csr")
    problem = fclib.LocalProblem(blocks, np.ones(3 * n), np.full(n, 0.5)).to_contact_problem()
    assert problem.is_sparse
    np.testing.assert_array_equal(problem.dense_delassus(), blocks.toarray())
    planar = sp.block_diag([delassus(2, k) for k in range(n)], format="csr")
    problem = fclib.LocalProblem(planar, np.ones(2 * n), np.full(n, 0.5), spacedim=2).to_contact_problem()
    assert problem.is_sparse and problem.dimension == 2
    np.testing.assert_array_equal(problem.dense_delassus()[np.ix_([3, 5], [3, 5])], delassus(2, 1))
    assert not problem.dense_delassus()[1::3].any()
    full = fclib.LocalProblem(delassus(303), np.ones(303), np.full(101, 0.5)).to_contact_problem()
    assert not full.is_sparse


# What a file means


def write_by_hand(path: Path, main: str, content: dict[str, object]) -> None:
    with h5py.File(path, "w") as file:
        for name, value in content.items():
            file.create_dataset(f"{main}/{name}", data=value)


def matrix_by_hand(name: str, A: np.ndarray) -> dict[str, object]:
    """By rows."""
    A = sp.csr_array(A)
    sizes = {"m": A.shape[0], "n": A.shape[1], "nz": -2, "nzmax": A.nnz, "p": A.indptr, "i": A.indices, "x": A.data}
    return {f"{name}/{key}": [value] if np.ndim(value) == 0 else value for key, value in sizes.items()}


def by_hand(spacedim: int = 3) -> dict[str, object]:
    """Two contacts; the entry of component a of contact k and b of l is 1000 k + 100 l + 10 a + b, made symmetric."""
    rows = 2 * spacedim
    k, a = np.divmod(np.arange(rows), spacedim)
    W = 1000.0 * k[:, None] + 100 * k + 10 * a[:, None] + a
    W = W + W.T + 1e4 * np.eye(rows)
    q = 10.0 * k + a
    return {"spacedim": [spacedim], "vectors/q": q, "vectors/mu": [0.1, 0.2], **matrix_by_hand("W", W)}


def test_the_normal_comes_first_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "hand.hdf5"
    write_by_hand(path, "fclib_local", by_hand())
    problem = fclib.load(path)
    #                  x  y  z (normal): the file's t1, t2, n
    assert problem.free_velocity.tolist() == [1, 2, 0, 11, 12, 10]
    G = problem.dense_delassus()
    assert G[2, 2] == 1e4  # n, n of contact 0: the file's first
    assert G[0, 0] == 1e4 + 2 * 11 and G[1, 1] == 1e4 + 2 * 22
    assert G[0, 1] == G[1, 0] == 12 + 21
    assert G[2, 1] == 2 + 20  # n, t2: the file's [0, 2]
    assert G[2, 3] == 101 + 1010  # n of contact 0, t1 of contact 1
    assert problem.friction.tolist() == [0.1, 0.2]


def test_the_normal_comes_first_in_the_plane_too(tmp_path: Path) -> None:
    path = tmp_path / "hand.hdf5"
    write_by_hand(path, "fclib_local", by_hand(spacedim=2))
    assert fclib.load(path).free_velocity.tolist() == [1, 0, 0, 11, 0, 10]
    assert fclib.load(path).delassus[2, 3] == 101 + 1010


def test_what_is_written_has_the_normal_first(tmp_path: Path) -> None:
    path = tmp_path / "ours.hdf5"
    problem = ss.ContactProblem(np.diag([1.0, 2, 3, 4, 5, 6]), [1, 2, 3, 4, 5, 6], [0.5, 0.7])
    fclib.write(
        path,
        fclib.LocalProblem.from_contact_problem(problem),
        solution=fclib.Solution(u=[1, 2, 3, 4, 5, 6], r=[7, 8, 9, 10, 11, 12]),
        title="A title",
    )
    with h5py.File(path) as file:
        assert file["fclib_local/vectors/q"][:].tolist() == [3, 1, 2, 6, 4, 5]
        assert file["fclib_local/W/x"][:].tolist() == [3, 1, 2, 6, 4, 5]
        assert file["solution/u"][:].tolist() == [3, 1, 2, 6, 4, 5]
        assert file["solution/r"][:].tolist() == [9, 7, 8, 12, 10, 11]
        text = file["fclib_local/info/title"]
        assert text[()] == b"A title" and text.id.get_type().get_size() == 8, "C wants the zero at the end"
        assert "v" not in file["solution"] and "l" not in file["solution"]


@pytest.mark.parametrize("swapped", [False, True])
def test_triplets_of_either_meaning_are_read(tmp_path: Path, swapped: bool) -> None:
    """i rows and p columns, as programs write them, or p rows and i columns, as FCLIB's header says."""
    problem = global_problem(dofs=20, contacts=1, seed=3)
    fclib.write(tmp_path / "a.hdf5", problem, storage="triplet")
    with h5py.File(tmp_path / "a.hdf5", "r+") as file:
        H = file["fclib_global/H"]
        assert H["i"][:].max() >= 3 > H["p"][:].max()
        if swapped:
            H.move("i", "tmp")
            H.move("p", "i")
            H.move("tmp", "p")
    assert_equal(fclib.read(tmp_path / "a.hdf5"), problem)


def test_repeated_entries_add_up(tmp_path: Path) -> None:
    path = tmp_path / "twice.hdf5"
    content = {
        "spacedim": [3],
        "vectors/q": [0.0, 0, 0],
        "vectors/mu": [0.5],
        **{"W/m": [3], "W/n": [3], "W/nz": [5], "W/nzmax": [9]},  # room for more than there is
        **{"W/i": [0, 1, 2, 0, 0], "W/p": [0, 1, 2, 0, 0], "W/x": [1.0, 2, 3, 10, 100]},
    }
    write_by_hand(path, "fclib_local", content)
    np.testing.assert_array_equal(np.diag(fclib.load(path).dense_delassus()), [2, 3, 111])
    content |= {
        "W/nz": [-2],
        "W/nzmax": [6],
        "W/p": [0, 3, 4, 5],
    }  # in a row, not sorted, with an entry that is not used
    content |= {"W/i": [0, 0, 0, 1, 2, 77], "W/x": [100.0, 10, 1, 2, 3, np.pi]}
    write_by_hand(path, "fclib_local", content)
    np.testing.assert_array_equal(np.diag(fclib.load(path).dense_delassus()), [2, 3, 111])


def test_other_number_types_and_scalars_without_dimension_are_read(tmp_path: Path) -> None:
    content = by_hand()
    for name in ("spacedim", "W/m", "W/n", "W/nz", "W/nzmax"):
        content[name] = np.int64(content[name][0])
    content["W/p"] = np.asarray(content["W/p"], dtype=">u8")
    content["W/x"] = np.asarray(content["W/x"], dtype=np.float32)
    content["vectors/q"] = np.asarray(content["vectors/q"], dtype=np.int16)
    write_by_hand(tmp_path / "hand.hdf5", "fclib_local", content)
    assert fclib.load(tmp_path / "hand.hdf5").free_velocity.tolist() == [1, 2, 0, 11, 12, 10]


def test_texts_in_any_encoding_are_read(tmp_path: Path) -> None:
    texts = {"info/title": np.bytes_(b"\xa8LMGC"), "info/description": "variable length é"}
    write_by_hand(tmp_path / "hand.hdf5", "fclib_local", by_hand() | texts)
    problem = fclib.read(tmp_path / "hand.hdf5")
    assert problem.title == "\ufffdLMGC" and problem.description == "variable length é" and problem.math_info == ""


def test_a_file_with_both_forms_asks_which(tmp_path: Path) -> None:
    fclib.write(tmp_path / "a.hdf5", local_problem())
    fclib.write(tmp_path / "b.hdf5", global_problem())
    with h5py.File(tmp_path / "a.hdf5", "r+") as a, h5py.File(tmp_path / "b.hdf5") as b:
        del a["solution"], a["guesses"]
        b.copy("fclib_global", a)
    with pytest.raises(ValueError, match="holds fclib_local and fclib_global; say which one with form='local' or"):
        fclib.read(tmp_path / "a.hdf5")
    assert isinstance(fclib.read(tmp_path / "a.hdf5", form="local"), fclib.LocalProblem)
    assert isinstance(fclib.read(tmp_path / "a.hdf5", form="global"), fclib.GlobalProblem)
    with pytest.raises(ValueError, match="form is 'dual'"):
        fclib.load(tmp_path / "a.hdf5", form="dual")


# Masses and constraints


@pytest.mark.parametrize("spacedim", [2, 3])
def test_a_global_problem_is_the_local_one_of_its_masses(tmp_path: Path, spacedim: int) -> None:
    problem = global_problem(spacedim=spacedim)
    fclib.write(tmp_path / "a.hdf5", problem)
    loaded = fclib.load(tmp_path / "a.hdf5")
    M, H = problem.M.toarray(), problem.H.toarray()
    W = H.T @ np.linalg.solve(M, H)
    q = H.T @ np.linalg.solve(M, problem.f) + problem.w
    keep = np.arange(9) if spacedim == 3 else np.flatnonzero(np.arange(9) % 3 != 1)
    np.testing.assert_allclose(loaded.dense_delassus()[np.ix_(keep, keep)], W, rtol=0, atol=1e-13)
    np.testing.assert_allclose(loaded.free_velocity[keep], q, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(loaded.dense_delassus(), loaded.dense_delassus().T)


@pytest.mark.parametrize("local_first", [False, True])
def test_equality_constraints_are_eliminated_exactly(local_first: bool) -> None:
    problem = global_problem(dofs=12, constraints=3)
    reduced = (problem.to_local() if local_first else problem).to_contact_problem()
    # The saddle point M v - G l = H r + f, G' v = -b, solved as it stands.
    M, H, G = problem.M.toarray(), problem.H.toarray(), problem.G.toarray()
    saddle = np.block([[M, -G], [G.T, np.zeros((3, 3))]])

    def velocity(r: np.ndarray) -> np.ndarray:
        v = np.linalg.solve(saddle, np.concatenate([H @ r + problem.f, -problem.b]))[:12]
        return H.T @ v + problem.w

    for r in [np.zeros(9), *np.eye(9)]:
        np.testing.assert_allclose(
            reduced.dense_delassus() @ r + reduced.free_velocity, velocity(r), rtol=0, atol=1e-12
        )


def test_many_right_hand_sides_are_solved_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = global_problem(dofs=30, contacts=10)
    whole = problem.to_contact_problem()
    monkeypatch.setattr(fclib.elimination, "_COLUMNS", 7)
    np.testing.assert_allclose(
        problem.to_contact_problem().dense_delassus(), whole.dense_delassus(), rtol=0, atol=1e-14
    )


def test_separate_bodies_give_a_sparse_operator() -> None:
    M = sp.block_diag([delassus(6, k) for k in range(50)])
    H = sp.block_diag([np.random.default_rng(k).normal(size=(6, 3)) for k in range(50)])
    problem = fclib.GlobalProblem(M, H, np.ones(300), np.zeros(150), np.ones(50))
    assert problem.to_local().W.nnz == 50 * 9


@pytest.mark.parametrize(
    ("M", "says"),
    [
        (np.diag([1.0, 2, 0]), "M is singular"),
        (np.ones((3, 3)), "M is singular"),
        (np.diag([1.0, -2, 3]), r"M is indefinite: elimination leaves -2 of \[1, 1\] = -2"),
        (np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]]), "M is indefinite"),
        (np.array([[1.0, 2, 0], [2, 1, 0], [0, 0, 1]]), "M is indefinite"),
        (np.array([[1.0, 1, 0], [1, 1 + 2e-16, 0], [0, 0, 1]]), "M is singular to working precision"),
        (np.array([[1.0, 0.1, 0], [0, 1, 0], [0, 0, 1]]), "M is not symmetric: .0, 1. and .1, 0. differ by 0.1, 0.1"),
        (1e-308 * np.eye(3), "M: its inverse overflows"),
    ],
)
def test_masses_that_are_no_masses_are_refused(M: np.ndarray, says: str) -> None:
    problem = fclib.GlobalProblem(M, 10 * np.eye(3), 10 * np.ones(3), np.zeros(3), [0.5], source="a.hdf5")
    with pytest.raises(ValueError, match=f"^a.hdf5: fclib_global: {says}"):
        problem.to_contact_problem()


def test_redundant_constraints_are_refused_by_name() -> None:
    problem = global_problem(constraints=1)
    twice = sp.hstack([problem.G, problem.G])
    problem = fclib.GlobalProblem(problem.M, problem.H, problem.f, problem.w, problem.mu, G=twice, b=[1, 1])
    with pytest.raises(ValueError, match="R is singular.*redundant or contradictory equality constraints"):
        problem.to_contact_problem()


def test_slight_asymmetry_is_mended_and_told() -> None:
    for size, told in [(0, False), (1e-10, False), (1e-8, True), (0.9e-2, True)]:
        W = np.diag([1.0, 2, 2, 1, 1, 1])
        W[4, 3] = 2 * size
        problem = fclib.LocalProblem(W, np.zeros(6), [0.5, 0.5])
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            G = problem.to_contact_problem().dense_delassus()
        np.testing.assert_allclose([G[3, 4], G[4, 3]], size, rtol=1e-12)
        assert [w.category for w in caught] == [UserWarning] * told
        if told:
            says = f"differ by {2 * size:.3g}, {size:.2g} of the largest entry; its symmetric part is used"
            assert f"[3, 4] and [4, 3] (rows in the order x, y, z) {says}" in str(caught[0].message)
            assert caught[0].filename == __file__
    W[4, 3] = 2.2e-2
    with pytest.raises(ValueError, match="W is not symmetric.* 0.011 of the largest entry; at most 0.01 is mended"):
        fclib.LocalProblem(W, np.zeros(6), [0.5, 0.5]).to_contact_problem()


def test_errors_of_the_problem_name_the_file(tmp_path: Path) -> None:
    fclib.write(tmp_path / "a.hdf5", fclib.LocalProblem(np.diag([1.0, 1, -1]), np.zeros(3), [0.5]))
    with pytest.raises(ValueError, match="a.hdf5: fclib_local: .*delassus"):
        fclib.load(tmp_path / "a.hdf5")
