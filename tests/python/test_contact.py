"""Contact problems from Python: shapes, errors, both laws, every method, agreement with the residual."""

import copy
import pickle
import re

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st
from scipy import sparse

import stickslip as ss
from stickslip.contact import _time_single_contact

BLOCK = np.array([[2, 0.5, 0.3], [0.5, 1, -0.2], [0.3, -0.2, 1.5]])
C = np.array([1.0, -2, -3])


def random_problem(n: int, seed: int = 0) -> ss.ContactProblem:
    """n feet: six shared dofs, three of their own each."""
    rng = np.random.default_rng(seed)
    Y = np.zeros((3 * n, 6 + 3 * n))
    Y[:, :6] = rng.normal(size=(3 * n, 6)) * 0.3
    for i in range(n):
        Y[3 * i : 3 * i + 3, 6 + 3 * i : 9 + 3 * i] = rng.normal(size=(3, 3))
    return ss.ContactProblem(Y @ Y.T, rng.normal(size=3 * n) - np.tile([0, 0, 1], n), rng.uniform(0.3, 1, n))


def coulomb_residual(p: ss.ContactProblem, impulse: np.ndarray) -> np.ndarray:
    """The De Saxce natural map, written again in NumPy."""
    out = []
    v = p.delassus @ impulse + p.free_velocity
    for i, mu in enumerate(p.friction):
        s = slice(3 * i, 3 * i + 3)
        rho = 3 / np.trace(p.delassus[s, s])
        u = v[s] + [0, 0, mu * np.hypot(*v[s][:2])]
        z = impulse[s] - rho * u
        t = np.hypot(z[0], z[1])
        if t <= mu * z[2]:
            projected = z
        elif mu * t <= -z[2]:
            projected = np.zeros(3)
        else:
            normal = (mu * t + z[2]) / (1 + mu**2)
            projected = np.array([mu * normal * z[0] / t, mu * normal * z[1] / t, normal])
        out.append(np.linalg.norm(impulse[s] - projected) / rho)
    return np.array(out)


@pytest.mark.parametrize("method", ["auto", "per_contact", "pgs"])
def test_every_method_meets_the_residual(method):
    for seed in range(20):
        p = random_problem(4, seed)
        s = ss.solve(p, method=method, max_sweeps=100000)
        assert s.converged and s.status == "converged"
        assert s.residual <= 1e-9
        np.testing.assert_allclose(s.velocity, p.delassus @ s.impulse + p.free_velocity, atol=1e-12)
        np.testing.assert_array_equal(s.contact_residuals, ss.residual(p, s.impulse))
        assert s.residual == s.contact_residuals.max()


def test_the_residual_is_the_natural_map():
    for seed in range(50):
        p = random_problem(3, seed)
        impulse = np.random.default_rng(seed).normal(size=9)
        np.testing.assert_allclose(ss.residual(p, impulse), coulomb_residual(p, impulse), rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("law", ["coulomb", "max_dissipation"])
@pytest.mark.parametrize("method", ["halley", "bisection", "quartic", "golden_section"])
def test_solve_contact_agrees_with_solve(method, law):
    if method == "golden_section" and law == "coulomb":
        with pytest.raises(ValueError, match="golden_section minimizes the energy"):
            ss.solve_contact(BLOCK, C, 0.5, method=method, law=law)
        return
    tolerance = 1e-6 if method == "golden_section" else 1e-10
    x = ss.solve_contact(BLOCK, C, 0.5, method=method, law=law, tolerance=tolerance)
    assert x.shape == (3,)
    s = ss.solve(ss.ContactProblem(BLOCK, C, [0.5]), law=law)
    np.testing.assert_allclose(x, s.impulse, atol=10 * tolerance + 1e-8)


def test_coulomb_friction_opposes_sliding_and_maximum_dissipation_does_not_quite():
    sine = {}
    for law in ("coulomb", "max_dissipation"):
        x = ss.solve_contact(BLOCK, C, 0.5, law=law)
        v = BLOCK @ x + C
        assert abs(v[2]) < 1e-9 and np.hypot(x[0], x[1]) == pytest.approx(0.5 * x[2])
        sine[law] = abs(x[0] * v[1] - x[1] * v[0]) / np.hypot(x[0], x[1]) / np.hypot(v[0], v[1])
    assert sine["coulomb"] < 1e-8
    assert sine["max_dissipation"] > 0.01


@hypothesis.given(
    n=st.integers(1, 6),
    rank=st.integers(1, 12),
    mu=st.floats(0, 3),
    seed=st.integers(0, 10**6),
    law=st.sampled_from(["coulomb", "max_dissipation"]),
)
@hypothesis.settings(max_examples=150, deadline=None)
def test_a_status_is_true_and_nothing_is_nan(n, rank, mu, seed, law):
    rng = np.random.default_rng(seed)
    Y = rng.normal(size=(3 * n, rank))
    p = ss.ContactProblem(Y @ Y.T, Y @ rng.normal(size=rank), np.full(n, mu))
    s = ss.solve(p, law=law, max_sweeps=200)
    assert np.isfinite(s.impulse).all() and np.isfinite(s.velocity).all() and np.isfinite(s.residual)
    assert s.converged == (ss.residual(p, s.impulse, law=law).max() <= 1e-9)
    # Every impulse lies in its cone, converged or not.
    x = s.impulse.reshape(-1, 3)
    assert (np.hypot(x[:, 0], x[:, 1]) <= mu * x[:, 2] + 1e-9 * (1 + abs(x).max())).all()


def test_a_warm_start_saves_sweeps():
    p = random_problem(4, 1)
    a = ss.solve(p, method="per_contact")
    b = ss.solve(p, method="per_contact", impulse=a.impulse)
    assert b.sweeps == 0 < a.sweeps and b.stage == "start"


def test_history_has_one_entry_per_sweep():
    p = random_problem(4, 2)
    s = ss.solve(p, method="per_contact", history=True)
    assert len(s.history) == s.sweeps + 1  # and the start
    assert s.history.stage == ["start"] + ["sweeps"] * s.sweeps
    assert s.history.residual[-1] <= 1e-9 and (np.diff(s.history.time) >= 0).all()
    assert len(ss.solve(p).history) == 0
    s = ss.solve(p, method="pgs", stop="update_sum", tolerance=1e-6, history=True)
    assert len(s.history) == s.sweeps + 1


def test_the_papers_settings_run():
    p = random_problem(4, 3)
    s = ss.solve(
        p,
        "per_contact",
        law="max_dissipation",
        tolerance=1e-6,
        single_contact="bisection",
        gamma=0.99,
        stop="violation_sum",
    )
    assert s.residual < 1e-5 and s.sweeps < 50


def test_bad_problems_raise_with_the_place():
    G, mu = np.eye(3), [0.5]
    for args, text in [
        ((np.eye(4), C, mu), r"delassus has shape \(4, 4\); it must be \(3, 3\) for 1 contacts"),
        ((G, C[:2], mu), r"free_velocity has shape \(2,\)"),
        ((G, C, [[0.5]]), r"friction has shape \(1, 1\)"),
        ((np.diag([1, np.nan, 1]), C, mu), r"delassus\[1, 1\] is nan"),
        ((np.diag([1, -1.0, 1]), C, mu), r"delassus\[1, 1\] is -1"),
        (([[1, 2, 0], [2, 1, 0], [0, 0, 1]], C, mu), "indefinite"),
        (([[1, 0.1, 0], [0, 1, 0], [0, 0, 1]], C, mu), r"not symmetric: \[1, 0\] and \[0, 1\] differ by 0.1"),
        ((G, [1, np.inf, 0], mu), r"free_velocity\[1\] is inf"),
        ((G, C, [-0.5]), r"friction\[0\] is -0.5"),
        ((G, C, [np.nan]), r"friction\[0\] is nan"),
        ((G, "abc", mu), "free_velocity holds <U3; it must hold real numbers"),
        ((G * (1 + 1j), C, mu), "delassus holds complex128; it must hold real numbers"),
        ((G * 1e80, C, mu), r"delassus has a largest entry of 1e\+80 1/kg; it must be 0 or lie in \[1e-40, 1e\+40\]"),
        ((G, C * 1e-80, mu), "free_velocity has a largest entry of 3e-80 m/s"),
    ]:
        with pytest.raises(ValueError, match=text):
            ss.ContactProblem(*args)


def test_bad_options_raise():
    p = ss.ContactProblem(BLOCK, C, [0.5])
    for options, text in [
        ({"method": "newton"}, "method is 'newton'; choose one of 'auto', 'per_contact', 'pgs', 'prox_newton'"),
        ({"method": "admm", "law": "max_dissipation"}, "admm solves law coulomb only"),
        ({"shift": "soft"}, "shift is 'soft'; choose one of 'lagged', 'damped', 'exact'"),
        ({"max_iterations": 0}, "max_iterations is 0; it must be at least 1"),
        ({"proximal_weight": 0}, "proximal_weight is 0"),
        ({"relative_tolerance": -1}, "relative_tolerance is -1"),
        ({"law": "dry"}, "law is 'dry'"),
        ({"tolerance": 0}, "tolerance is 0"),
        ({"tolerance": np.nan}, "tolerance is nan"),
        ({"max_sweeps": 0}, "max_sweeps is 0"),
        ({"impulse": [1, 2]}, r"impulse has shape \(2,\)"),
        ({"impulse": [1, 2, np.nan]}, r"impulse\[2\] is nan"),
        ({"method": "pgs", "law": "max_dissipation"}, "pgs solves law coulomb only"),
        ({"method": "per_contact", "single_contact": "golden_section"}, "golden_section"),
        ({"alpha": -1}, "alpha is -1"),
    ]:
        with pytest.raises(ValueError, match=text):
            ss.solve(p, **options)
    with pytest.raises(TypeError, match="a ContactProblem is wanted"):
        ss.solve(BLOCK)
    with pytest.raises(ValueError, match=r"delassus has shape \(2, 2\)"):
        ss.solve_contact(np.eye(2), C, 0.5)
    with pytest.raises(ValueError, match=r"friction\[0\] is -1"):
        ss.solve_contact(BLOCK, C, -1)


def test_problems_are_read_only_copies():
    G = BLOCK.copy()
    p = ss.ContactProblem(G, C, [0.5])
    G[0, 0] = 99
    assert p.delassus[0, 0] == 2 and p.num_contacts == 1
    with pytest.raises(ValueError):
        p.delassus[0, 0] = 1


def test_no_contacts_is_a_solved_problem():
    s = ss.solve(ss.ContactProblem(np.zeros((0, 0)), [], []))
    assert s.converged and s.impulse.shape == (0,)


def test_a_contact_that_cannot_push_is_infeasible():
    s = ss.solve(ss.ContactProblem(np.diag([1.0, 1, 0]), [0, 0, -1], [0.5]))
    assert s.status == "infeasible" and not s.converged and s.residual > 0.1


def test_methods_are_timed_on_given_contacts():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(200, 3, 6))
    G = A @ A.transpose(0, 2, 1)
    c = rng.normal(size=(200, 3)) - [0, 0, 1]
    times = _time_single_contact(
        G, c, np.full(200, 0.5), ["halley", "bisection", "golden_section", "quartic"], rounds=3
    )
    assert set(times) == {"halley", "bisection", "golden_section", "quartic"}
    for ns, evaluations, failures in times.values():
        assert 0 < ns < 1e6 and evaluations >= 1 and 0 <= failures <= 1
    assert times["halley"][2] == times["bisection"][2] == 0


def test_a_block_in_the_plane_sticks_or_slides_by_its_closed_form():
    """m = 2 kg pressed down at 1 m/s and along x at u: sticks up to u = mu, beyond keeps u - mu."""
    for u, mu, kept in ((0.3, 0.5, 0.0), (0.8, 0.5, 0.3), (-0.8, 0.5, -0.3), (0.8, 0.0, 0.8)):
        p = ss.ContactProblem.planar(np.eye(2) / 2, [u, -1], [mu])
        assert p.dimension == 2 and p.num_contacts == 1
        for method in ss.contact.SOLVE_METHODS:
            s = ss.solve(p, method=method, tolerance=1e-6)
            assert s.converged, (method, u, mu)
            np.testing.assert_allclose(s.velocity, [kept, 0, 0], atol=1e-5)
            np.testing.assert_allclose(s.impulse, [2 * (kept - u), 0, 2], atol=1e-4)


def test_errors_of_problems_in_the_plane_count_its_rows():
    G, c, mu = np.eye(4), np.zeros(4), [0.5, 0.5]
    skewed, negative, indefinite = G.copy(), G.copy(), G.copy()
    skewed[1, 3], negative[3, 3], indefinite[2, 3], indefinite[3, 2] = 1, -1, 5, 5
    for matrix, text in [
        (skewed, r"not symmetric: \[3, 1\] and \[1, 3\] differ by 1"),
        (negative, r"delassus\[3, 3\] is -1"),
        (indefinite, "rows and columns 0 to 3 have an eigenvalue below"),
    ]:
        with pytest.raises(ValueError, match=text):
            ss.ContactProblem.planar(matrix, c, mu)
    with pytest.raises(ValueError, match=r"free_velocity has shape \(4,\).*made by ContactProblem.planar"):
        ss.ContactProblem(G, c, mu)


def test_one_friction_may_serve_all_contacts():
    p = random_problem(3)
    q = ss.ContactProblem(p.delassus, p.free_velocity, 0.4)
    np.testing.assert_array_equal(q.friction, [0.4, 0.4, 0.4])


def test_a_solution_shows_itself_in_one_line():
    assert re.fullmatch(
        r"ContactSolution\(converged, 4 contacts, stage \w+, residual \S+ m/s\)", repr(ss.solve(random_problem(4)))
    )


def test_sparse_problems_are_kept_in_blocks_and_solved_like_dense_ones():
    p = random_problem(4, 5)
    rng = np.random.default_rng(0)
    order = rng.permutation(12 * 12)
    rows, columns = np.divmod(order, 12)
    shuffled = sparse.coo_array((p.delassus[rows, columns], (rows, columns)), shape=(12, 12))
    for form in (
        sparse.csr_matrix(p.delassus),
        sparse.csc_array(p.delassus),
        sparse.bsr_array(p.delassus, blocksize=(2, 2)),
        shuffled,
    ):
        q = ss.ContactProblem(form, p.free_velocity, p.friction)
        assert q.is_sparse and q.delassus.blocksize == (3, 3) and not p.is_sparse
        np.testing.assert_array_equal(q.dense_delassus(), p.delassus)
        np.testing.assert_allclose(ss.solve(q).velocity, ss.solve(p).velocity, atol=1e-8)
        with pytest.raises(ValueError):
            q.delassus.data[0, 0, 0] = 1
    # Contacts that couple with nobody, one of them with nothing: its diagonal block is stored all the same.
    q = ss.ContactProblem(sparse.csr_array(np.diag([1.0, 1, 1, 0, 0, 0])), [0.1, 0, -1, 0, 0, 1], [0.5, 0.5])
    assert q.delassus.nnz == 18 and ss.solve(q).converged


def test_bad_sparse_problems_raise_with_the_place():
    good = sparse.csr_array(random_problem(2).delassus)
    c, mu = np.zeros(6), [0.5, 0.5]
    skewed, negative, broken = good.toarray(), good.toarray(), good.toarray()
    skewed[0, 4] += 1
    negative[4, 4] = -2
    broken[1, 2] = np.nan
    for matrix, text in [
        (sparse.csr_array((5, 6)), r"delassus has shape \(5, 6\); it must be \(6, 6\) for 2 contacts"),
        (good * 1j, "delassus holds complex128"),
        (sparse.csr_array(skewed), r"not symmetric: \[0, 4\] and \[4, 0\] differ by 1 "),
        (sparse.csr_array(negative), r"delassus\[4, 4\] is -2"),
        (sparse.csr_array(broken), r"delassus\[1, 2\] is nan"),
        (sparse.csr_array(np.diag([1.0, 1, 1, 1, 1, 1]) + 2 * np.eye(6, k=3) + 2 * np.eye(6, k=-3)), "indefinite"),
    ]:
        with pytest.raises(ValueError, match=text):
            ss.ContactProblem(matrix, c, mu)


def test_a_certificate_says_what_is_wrong_with_an_impulse():
    p = ss.ContactProblem(np.eye(3), [-2.0, 0.3, -0.6], [0.5])
    c = ss.certify(p, [0.5, 0, 1])  # v = (-1.5, 0.3, 0.4), friction along x at its limit
    assert c.residual == c.residuals[0] == ss.residual(p, [0.5, 0, 1])[0]
    assert c.backward_error == pytest.approx(0.5) and c.backward_errors.shape == (1,)
    assert c.direction_error == pytest.approx(np.arctan2(0.3, 1.5))
    assert c.penetration_speed == 0 and c.cone_violation == 0
    assert c.power == pytest.approx(abs(-0.75 + 0.4 + 0.5 * np.hypot(1.5, 0.3)))
    with pytest.raises(ValueError, match=r"impulse has shape \(2,\)"):
        ss.certify(p, [1, 2])


def test_redundant_contacts_may_ask_for_the_least_tangential_impulses():
    p = ss.problems.duplicated_contacts(seed=4)
    a, b = ss.solve(p), ss.solve(p, minimum_norm=True)
    tangential = [np.delete(s.impulse, np.s_[2::3]) for s in (a, b)]
    assert np.linalg.norm(tangential[1]) <= np.linalg.norm(tangential[0]) * (1 + 1e-12)
    assert b.converged
    np.testing.assert_allclose(a.velocity, b.velocity, atol=1e-7)


def test_an_empty_sparse_problem_is_solved():
    s = ss.solve(ss.ContactProblem(sparse.csr_array((0, 0)), [], []))
    assert s.converged and s.impulse.shape == (0,)


@pytest.mark.parametrize("make", [np.asarray, sparse.csr_array], ids=["dense", "sparse"])
def test_problems_are_copied_and_pickled_whole(make):
    p = ss.ContactProblem(make(random_problem(2).delassus), np.ones(6), [0.5, 0.6])
    for q in (copy.deepcopy(p), pickle.loads(pickle.dumps(p))):
        assert q.is_sparse == p.is_sparse
        np.testing.assert_array_equal(q.dense_delassus(), p.dense_delassus())
        np.testing.assert_array_equal(ss.solve(q).impulse, ss.solve(p).impulse)
    planar = pickle.loads(pickle.dumps(ss.ContactProblem.planar(np.eye(2), [1, -1], [0.5])))
    assert planar.dimension == 2


def test_a_sparse_problem_cannot_be_changed_through_what_it_returns():
    p = ss.ContactProblem(sparse.csr_array(random_problem(2).delassus), np.ones(6), [0.5, 0.6])
    kept = p.dense_delassus()
    for array in (p.delassus.data, p.delassus.indices, p.delassus.indptr):
        with pytest.raises(ValueError):
            array[0] = 1
    p.delassus.data = np.zeros_like(p.delassus.data)
    np.testing.assert_array_equal(p.dense_delassus(), kept)


@pytest.mark.parametrize("method", ss.contact.SOLVE_METHODS)
@pytest.mark.parametrize("size", [1e3, 1e100, 1e160])
def test_a_bad_start_is_no_worse_than_none(method, size):
    p = ss.problems.quadruped_impact(seed=2)
    start = size * np.tile([1.0, -1, 2], p.num_contacts)
    s = ss.solve(p, method, impulse=start, tolerance=1e-6, max_sweeps=5000)
    rest = ss.solve(p, method, tolerance=1e-6, max_sweeps=5000)
    assert s.converged == rest.converged and s.residual <= max(rest.residual, 1e-6) * (1 + 1e-9)


def test_impulses_that_overflow_have_an_infinite_residual():
    p = random_problem(2)
    c = ss.certify(p, np.full(6, 1e300))
    assert c.residual == np.inf and not np.isnan(c.residuals).any() and not np.isnan(c.backward_errors).any()


@pytest.mark.parametrize("alpha", [0.5, 1.5, 1.9])
def test_relaxed_sweeps_end_inside_the_cones(alpha):
    for seed in range(10):
        p = random_problem(4, seed)
        s = ss.solve(p, "per_contact", alpha=alpha, alpha_min=alpha, max_sweeps=7, tolerance=1e-12)
        assert s.certificate.cone_violation <= 1e-15
