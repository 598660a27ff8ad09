"""What holds for every contact problem, whatever its conditioning, friction, units, form and start: no exception, no NaN, a true status.

The residual that judges a status is the long double one of oracles.py. The middle part goes where numbers overflow, contacts are
few or none, and where no solution exists. The last part changes a problem in ways that must not matter (order of contacts, units,
directions of the tangential axes, storage) and expects the same velocity.
"""

from __future__ import annotations

import itertools

import hypothesis
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import strategies as st

import oracles
import stickslip as ss
from oracles import Real, norm

FRICTION = st.one_of(st.sampled_from([0.0, 0.3, 0.8, 1e6, np.inf]), st.floats(1e-12, 3), st.floats(1e-12, 1e9))
UNITS = st.one_of(st.sampled_from([0, 0, 0, -6, -1, 1, 6]), st.integers(-25, 25))  # powers of ten
SMALLEST, LARGEST = 1e-40, 1e40  # of the largest entries of G and c, where they are not zero
FORMS = {"dense": np.asarray, "csr": sp.csr_array, "bsr": lambda G: sp.bsr_array(G, blocksize=(3, 3))}
IN_PLANE = {"planar": np.asarray, "planar csr": sp.csr_array}


def scaled_to(a: np.ndarray, largest: float) -> np.ndarray:
    """With exactly this largest entry, or zero."""
    most = np.abs(a).max(initial=0)
    return a / most * largest if most > 0 else a


def built(form: str, G, c, mu) -> ss.ContactProblem:
    """The problem stored this way; planar ones drop the y rows."""
    if form in FORMS:
        return ss.ContactProblem(FORMS[form](G), c, mu)
    rows = np.delete(np.arange(len(c)), np.s_[1::3])
    return ss.ContactProblem.planar(IN_PLANE[form](G[np.ix_(rows, rows)]), c[rows], mu)


@st.composite
def rows_and_velocities(draw, n: int, rng):
    """(Y, c): G = Y Y^T has rows as unlike as 1e8 to 1, any rank, blocks that are zero; most c push."""
    rank = draw(st.integers(1, 3 * n + 2))
    Y = rng.normal(size=(3 * n, rank)) * 10 ** (rng.uniform(-1, 0, rank) * draw(st.sampled_from([0, 0, 3, 8])))
    Y *= 10 ** (rng.uniform(-1, 0, (3 * n, 1)) * draw(st.sampled_from([0, 0, 0, 3, 8])))
    if draw(st.booleans()):  # contacts that share few dofs, so that blocks are zero
        Y *= np.repeat(rng.random((n, rank)) < 0.4, 3, axis=0)
    if draw(st.booleans()) and n > 1:  # duplicated contacts
        Y[3:6] = Y[:3]
    if draw(st.integers(0, 7)) == 0:  # rows that nothing moves
        Y[rng.random(3 * n) < 0.3] = 0
    kind = draw(st.sampled_from(["in the range"] * 4 + ["any"] * 2 + ["zero"]))
    c = {"in the range": Y @ rng.normal(size=rank), "any": rng.normal(size=3 * n), "zero": np.zeros(3 * n)}[kind]
    return Y, c * (-1 if c[2::3].sum() > 0 else 1)


@st.composite
def problems(draw):
    """A problem of 0 to 6 contacts in any units up to the ends of the range, stored in any form."""
    n = draw(st.integers(0, 6))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    Y, c = draw(rows_and_velocities(n, rng))
    form = draw(st.sampled_from(["dense", *FORMS, *IN_PLANE, "dense plane"]))
    if "plan" in form:
        Y[1::3] = c[1::3] = 0
    G = Y @ Y.T
    G = (G + G.T) / 2
    if draw(st.integers(0, 4)) == 0:  # the largest entry of G that is positive semidefinite is on its diagonal
        ends = st.sampled_from([SMALLEST, 1.0, LARGEST])
        G, c = scaled_to(G, draw(ends)), scaled_to(c, draw(ends))
    else:
        mass, length, time = (10.0 ** draw(UNITS) for _ in range(3))
        G, c = G / mass, c * (length / time)
    mu = np.array([draw(FRICTION) for _ in range(n)]) if draw(st.booleans()) else np.full(n, draw(FRICTION))
    hypothesis.assume(
        all(np.abs(a).max(initial=0) in (0, np.clip(np.abs(a).max(initial=0), SMALLEST, LARGEST)) for a in (G, c))
    )
    return built(form.removesuffix(" plane"), G, c, mu)


@st.composite
def starts(draw):
    """What makes a warm start of a problem: none, random ones of any size, and what lies near a solution or is one."""
    kind = draw(st.sampled_from(["none", "none", "random", "absurd", "near", "solution"]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    power = draw(st.integers(-3, 3) if kind == "random" else st.integers(-12, -2))
    if kind == "absurd":
        power = draw(st.one_of(st.integers(3, 160), st.integers(-160, -3)))

    def start(p: ss.ContactProblem) -> np.ndarray | None:
        if kind == "none":
            return None
        noise = rng.normal(size=3 * p.num_contacts) * impulse_size(p)
        if kind in ("random", "absurd"):
            return np.clip(noise, -1e140, 1e140) * 10.0**power
        x = ss.solve(p, tolerance=0, relative_tolerance=1e-9, max_sweeps=100).impulse
        return x if kind == "solution" else x * (1 + 10.0**power * rng.normal(size=len(x))) + 10.0**power * noise

    return start


def impulse_size(p: ss.ContactProblem) -> float:
    """What impulses are about as large as [N s]."""
    most = p.delassus.diagonal().max(initial=0)
    return np.abs(p.free_velocity).max(initial=0) / most if most > 0 else 1.0


@st.composite
def options(draw):
    """Method, law, tolerances, relaxation, stop of `solve`."""
    method, law = draw(st.sampled_from(CHOICES))
    tolerance, relative = draw(st.sampled_from(LIMITS))
    o = {"method": method, "law": law, "tolerance": tolerance, "relative_tolerance": relative, "max_sweeps": 100}
    if method in ("per_contact", "pgs"):
        factor = st.one_of(st.just(1.0), st.floats(0, 2, exclude_min=True), st.floats(1, 2))
        o |= {"alpha": draw(factor), "alpha_min": draw(factor), "gamma": draw(st.sampled_from([1.0, 1.0, 0.9, 0.0]))}
        o |= {"stop": draw(st.sampled_from(["residual", "residual", "violation_sum", "update_sum"]))}
    return o


def laws_of(method: str) -> list[str]:
    """The laws that a method knows; the others are refused by name."""
    laws = ["coulomb"]
    try:
        ss.solve(ss.ContactProblem(np.eye(3), [1, 0, -1], [0.5]), method=method, law="max_dissipation")
        laws.append("max_dissipation")
    except ValueError as error:
        assert "coulomb" in str(error)
    return laws


LIMITS = [(1e-9, 0.0), (0.0, 1e-12), (0.0, 1e-9), (0.0, 1e-6), (1e-9, 1e-3)]  # absolute [m/s], relative
CHOICES = [(method, law) for method in ss.contact.SOLVE_METHODS for law in laws_of(method)]


def check_cones(p: ss.ContactProblem, impulse: np.ndarray):
    """But for impulses whose squares underflow: those of problems inside the range are 1e-150 N s or more."""
    x, mu = impulse.reshape(-1, 3), np.minimum(p.friction, 1e4)
    t = np.hypot(x[:, 0], x[:, 1])
    assert (x[:, 2] >= 0).all(), x
    assert (t <= mu * x[:, 2] * (1 + 1e-13) + 1e-160).all(), f"{x} leaves the cones of {mu}"


def check_max_dissipation(p: ss.ContactProblem, s: ss.ContactSolution, limit: float):
    """What the law implies at each contact of a solved problem: it opens, it stays, or it cannot push."""
    G = p.dense_delassus()
    size = norm((np.abs(G) @ np.abs(s.impulse) + np.abs(p.free_velocity)).reshape(-1, 3))
    v, x = oracles.velocities(G, p.free_velocity, s.impulse), s.impulse.reshape(-1, 3)
    for i in range(p.num_contacts):
        block = G[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        own = block.astype(Real) @ x[i]
        allowed = limit * (1 + 1e-6) + 1e-10 * norm(v[i] - own) + 100 * oracles.UNIT * size[i]
        opens = norm(own) <= allowed and v[i, 2] - own[2] >= -allowed
        stays = abs(v[i, 2]) <= allowed
        idle = block[2, 2] <= 1e-12 * np.trace(block) and norm(own) <= allowed
        assert v[i, 2] >= -allowed and (opens or stays or idle), f"contact {i}: v = {v[i]}, impulse = {x[i]}"


def pushes(p: ss.ContactProblem) -> np.ndarray:
    """(n,) Contacts that their own impulse moves along the normal. The others decide nothing: no impulse helps them."""
    blocks = p.delassus.diagonal().reshape(-1, 3)
    return blocks[:, 2] > 1e-12 * blocks.sum(1)


def reachable_residual(p: ss.ContactProblem, impulse: np.ndarray, law: str) -> float:
    return ss.residual(p, impulse, law)[pushes(p)].max(initial=0)


def check_answer(p: ss.ContactProblem, s: ss.ContactSolution, limit: float, method: str = "auto", law: str = "coulomb"):
    """Finite, inside the cones, no worse than rest, and converged if and only if the oracle says so."""
    for a in (s.impulse, s.velocity, s.contact_residuals, [s.residual]):
        assert np.isfinite(a).all()
    check_cones(p, s.impulse)
    np.testing.assert_array_equal(s.contact_residuals, ss.residual(p, s.impulse, law=law))
    assert s.residual == s.contact_residuals.max(initial=0)
    assert s.converged == (s.residual <= limit) == (s.status == "converged")
    G = p.dense_delassus()
    assert reachable_residual(p, s.impulse, law) <= max(reachable_residual(p, 0 * s.impulse, law), limit)
    if s.status == "infeasible":
        assert (~pushes(p) & (s.velocity[2::3] < 0)).any()
    if law == "max_dissipation":
        if s.converged:
            check_max_dissipation(p, s, limit)
        return
    args = (G, p.free_velocity, p.friction, s.impulse)
    exact, rounding = oracles.natural_map(*args), oracles.natural_map_rounding(*args)
    assert (np.abs(exact - s.contact_residuals) <= rounding).all()
    if s.converged:
        assert (exact <= limit * (1 + 1e-6) + rounding).all()
    else:
        assert (exact >= limit * (1 - 1e-6) - rounding).any()


def limit_of(p: ss.ContactProblem, tolerance: float, relative: float) -> float:
    return tolerance + relative * np.abs(p.free_velocity).max(initial=0)


@hypothesis.given(p=problems(), start=starts(), options=options())
@hypothesis.settings(max_examples=1600, deadline=None, derandomize=True)
def test_every_method_answers_every_problem_with_a_true_status(p, start, options):
    s = ss.solve(p, impulse=start(p), **options)
    limit = limit_of(p, options["tolerance"], options["relative_tolerance"])
    check_answer(p, s, limit, options["method"], options["law"])
    if p.dimension == 2:
        assert not s.velocity[1::3].any()


@hypothesis.given(p=problems(), choice=st.sampled_from(CHOICES), seed=st.integers(0, 2**32), power=st.integers(3, 160))
@hypothesis.settings(max_examples=400, deadline=None, derandomize=True)
def test_an_absurd_start_gives_the_bits_of_a_start_from_rest(p, choice, seed, power):
    """Absurd: more than a thousand times the residual of rest, over the contacts that can push."""
    method, law = choice
    start = np.random.default_rng(seed).normal(size=3 * p.num_contacts) * impulse_size(p)
    start = np.clip(start, -1e140, 1e140) * 10.0**power
    rest = np.zeros_like(start)
    absurd, at_rest = (
        ss.solve(p, method, law, tolerance=0, relative_tolerance=1e-9, max_sweeps=100, impulse=x) for x in (start, rest)
    )
    check_answer(p, absurd, limit_of(p, 0, 1e-9), method, law)
    if reachable_residual(p, inside(p, start), law) > 1.01e3 * reachable_residual(p, rest, law):
        np.testing.assert_array_equal(absurd.impulse, at_rest.impulse)
        assert absurd.status == at_rest.status


def inside(p: ss.ContactProblem, impulse: np.ndarray) -> np.ndarray:
    """What a solve takes a start for: the tangential part shortened, nothing where a contact cannot push."""
    x = np.where(pushes(p)[:, None], impulse.reshape(-1, 3), 0)
    z, t = np.maximum(x[:, 2], 0), np.hypot(x[:, 0], x[:, 1])
    shorter = np.minimum(1, np.minimum(p.friction, 1e4) * z / np.where(t > 0, t, 1))
    return np.column_stack([x[:, 0] * shorter, x[:, 1] * shorter, z]).reshape(-1)


# The ends of the range, nothing at all, no solution ------------------------------------------------------------------


def ends_problem(form: str, n: int, G_largest: float, c_largest: float) -> ss.ContactProblem:
    G, c, mu = oracles.robot(np.random.default_rng(n), n)
    if form in IN_PLANE:
        c[1::3] = 0
    return built(form, scaled_to(G, G_largest), scaled_to(c, c_largest), mu)


@pytest.mark.parametrize("form", [*FORMS, *IN_PLANE])
@pytest.mark.parametrize("G_largest", [SMALLEST, 1.0, LARGEST])
@pytest.mark.parametrize("c_largest", [SMALLEST, 1.0, LARGEST])
def test_problems_at_the_ends_of_the_range_are_solved(form, G_largest, c_largest):
    for n in (1, 2, 4):
        p = ends_problem(form, n, G_largest, c_largest)
        if form in FORMS:
            assert p.delassus.max() == G_largest and np.abs(p.free_velocity).max() == c_largest
        unscaled = ss.solve(ends_problem(form, n, 1.0, 1.0), tolerance=0, relative_tolerance=1e-10)
        for method, law in CHOICES:
            s = ss.solve(p, method, law, tolerance=0, relative_tolerance=1e-10, max_sweeps=5000)
            check_answer(p, s, 1e-10 * c_largest, method, law)
            if method == "auto" and law == "coulomb":
                assert s.converged
                np.testing.assert_allclose(s.velocity / c_largest, unscaled.velocity, atol=1e-8)


@pytest.mark.parametrize("form", [*FORMS, *IN_PLANE])
def test_problems_beyond_the_ends_of_the_range_raise_with_the_argument(form):
    below, above = np.nextafter(SMALLEST, 0), np.nextafter(LARGEST, np.inf)
    for size in (below, above, 1e-200, 1e200, 1e-308, 1e308):
        for sizes, text in [
            ((size, 1.0), "delassus has a largest entry"),
            ((1.0, size), "free_velocity has a largest"),
        ]:
            with pytest.raises(ValueError, match=rf"ContactProblem\.{text}.*it must be 0 or lie in \[1e-40, 1e\+40\]"):
                built(
                    form,
                    scaled_to(np.eye(6), sizes[0]),
                    scaled_to(np.array([1.0, 0, -2, 0, 0, 1]), sizes[1]),
                    [0.5, 0.5],
                )


def test_single_contacts_at_the_ends_of_the_range_are_solved():
    G, c, mu = oracles.robot(np.random.default_rng(1), 1)
    G, c = scaled_to(G, 1.0), scaled_to(c, 1.0)
    expected = ss.solve_contact(G, c, mu[0])
    assert norm(expected) > 0
    for a, b in itertools.product([SMALLEST, 1.0, LARGEST], repeat=2):
        np.testing.assert_allclose(ss.solve_contact(G * a, c * b, mu[0]) * (a / b), expected, rtol=1e-8)
    for a, b, text in [
        (1e41, 1, "delassus"),
        (1e-41, 1, "delassus"),
        (1, 1e41, "free_velocity"),
        (1, 1e-41, "free_velocity"),
    ]:
        with pytest.raises(ValueError, match=f"{text} has a largest entry"):
            ss.solve_contact(G * a, c * b, mu[0])


@pytest.mark.parametrize("form", [*FORMS, *IN_PLANE])
@pytest.mark.parametrize(("method", "law"), CHOICES)
def test_no_contacts_are_solved_by_every_method(form, method, law):
    p = built(form, np.zeros((0, 0)), np.zeros(0), np.zeros(0))
    assert p.num_contacts == 0 and p.is_sparse == ("sr" in form)
    for start in (None, []):
        s = ss.solve(p, method, law, impulse=start, history=True)
        check_answer(p, s, 1e-9, method, law)
        assert s.status == "converged" and s.iterations == 0 and s.residual == ss.certify(p, [], law).residual == 0
    assert ss.solve(p, "auto", minimum_norm=True).converged


def jammed_rail() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A contact that moves along one line only, and is held there by friction while it is driven in: no impulse solves it."""
    line = np.array([1.45, 0.54, 0.33])
    return np.outer(line, line), np.array([1.0421, -0.6304, -1.0035]), np.array([1.123])


def side_by_side(*parts) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Problems that do not couple as one."""
    matrices, velocities, frictions = zip(*parts, strict=True)
    return sp.block_diag(matrices).toarray(), np.concatenate(velocities), np.concatenate(frictions)


def test_a_problem_without_a_solution_gets_nothing_worse_than_no_impulse():
    line = np.array([1, 0.3])
    in_plane = ss.ContactProblem.planar(np.outer(line, line), [0, -1], [5])
    for p in (ss.ContactProblem(*jammed_rail()), in_plane):
        for method in ss.contact.SOLVE_METHODS:
            s = ss.solve(p, method)
            check_answer(p, s, 1e-9)
            assert not s.converged and s.residual <= ss.residual(p, np.zeros(3)).max()


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("place", ["first", "between", "last"])
def test_what_jams_leaves_the_contacts_beside_it_solved(form, place):
    """Every contact of each robot to the tolerance, whatever the order of contacts, the start and the units."""
    rng = np.random.default_rng(5)
    for power in (0, -6, 6, 25):
        robots = [oracles.robot(rng, 4), oracles.robot(rng, 2, 2)]
        parts = {"first": [jammed_rail(), *robots], "last": [*robots, jammed_rail()]}.get(place)
        G, c, mu = side_by_side(*(parts or [robots[0], jammed_rail(), robots[1]]))
        rail = {"first": 0, "between": 4, "last": 8}[place]
        if place == "between":  # contacts of an island need not be neighbors
            G, c, mu, _ = permuted(rng, G, c, mu)
            rail = int(np.flatnonzero(mu == 1.123)[0])
        p = built(form, G * 10.0**power, c, mu)
        for start in (None, rng.exponential(size=len(c)) / 10.0**power, np.full(len(c), 1e100)):
            s = ss.solve(p, impulse=start)
            check_answer(p, s, 1e-9)
            assert not s.converged and s.contact_residuals[rail] > 1e-3
            assert (np.delete(s.contact_residuals, rail) <= 1e-9).all(), s.contact_residuals


def test_a_contact_that_cannot_push_leaves_the_others_solved():
    held = np.diag([1.0, 1, 0]), np.array([0.0, 0.1, -1]), np.array([0.5])
    for seed in range(10):
        robot = oracles.robot(np.random.default_rng(seed), 4)
        s = ss.solve(ss.ContactProblem(*side_by_side(held, robot)))
        assert s.status == "infeasible" and (s.contact_residuals[1:] <= 1e-9).all() and s.residual > 0.5


# In the plane --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", IN_PLANE)
@pytest.mark.parametrize("method", ss.contact.SOLVE_METHODS)
def test_problems_in_the_plane_get_one_of_their_solutions(method, form):
    """Each contact opens, sticks, slides left or right: all solutions are known."""
    rng = np.random.default_rng(6)
    solved = 0
    for k in range(120):
        n = 1 + k % 3
        Y = rng.normal(size=(2 * n, 2 * n + 1))
        c = rng.normal(size=2 * n)
        c[1::2] = -np.abs(c[1::2]) if k % 2 else c[1::2]
        mu = rng.uniform(0, [0.5, 1.5, 5][k // 3 % 3], n)
        G = Y @ Y.T
        p = ss.ContactProblem.planar(IN_PLANE[form](G), c, mu)
        s = ss.solve(p, method, tolerance=1e-7)
        check_answer(p, s, 1e-7, method)
        assert p.dimension == 2 and not s.velocity[1::3].any()
        v = np.delete(s.velocity, np.s_[1::3])
        solutions = [G @ x + c for x in oracles.planar_solutions(G, c, mu)]
        solved += s.converged
        if s.converged:
            assert min(np.abs(v - w).max() for w in solutions) <= 1e-4
    assert solved >= (120 if method == "auto" else 110)


# What must not matter ------------------------------------------------------------------------------------------------


def in_form(form: str):
    def change(rng, G, c, mu):
        return FORMS[form](G), c, mu, lambda v: v

    change.__name__ = f"in_{form}"
    return change


def permuted(rng, G, c, mu):
    """The problem with its contacts in another order, and how to bring a velocity back."""
    order = rng.permutation(len(mu))
    rows = (3 * order[:, None] + np.arange(3)).reshape(-1)
    return G[np.ix_(rows, rows)], c[rows], mu[order], lambda v: v[np.argsort(rows)]


def turned(rng, G, c, mu):
    """The problem with each contact frame turned about its normal by an angle of its own."""
    R = np.zeros_like(G)
    for i, angle in enumerate(rng.uniform(-np.pi, np.pi, len(mu))):
        cosine, sine = np.cos(angle), np.sin(angle)
        R[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = [[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]]
    H = R @ G @ R.T
    return (H + H.T) / 2, R @ c, mu, lambda v: R.T @ v


def in_other_units(rng, G, c, mu):
    """The problem in units of mass, length and time that are powers of ten."""
    mass, length, time = 10.0 ** rng.integers(-6, 7, 3)
    return G / mass, c * (length / time), mu, lambda v: v / (length / time)


SCENES = {
    "four feet": lambda rng: oracles.robot(rng, 4),
    "four feet and four corners": lambda rng: oracles.robot(rng, 4, 4),
    "a box": lambda rng: oracles.stack(rng, 1),
}


def solved(G, c, mu, **options):
    return ss.solve(ss.ContactProblem(G, c, mu), tolerance=0, relative_tolerance=1e-12, **options)


@pytest.mark.parametrize("change", [permuted, turned, in_other_units, *map(in_form, ["csr", "bsr"])])
@pytest.mark.parametrize("scene", SCENES)
def test_what_must_not_matter_does_not_change_the_velocity(scene, change):
    """To 1e-9 of max|c|, where the velocity is unique: hyperstatic contacts have several solutions now and then.

    A problem counts as unique if solves from five starts agree. If a changed problem still ends elsewhere, the oracle has to
    find both velocities exact.
    """
    rng = np.random.default_rng(1)
    unique = elsewhere = 0
    for _ in range(300):
        G, c, mu = SCENES[scene](rng)
        speed = np.abs(c).max()
        s = solved(G, c, mu)
        starts = rng.exponential(size=(4, len(c))) * speed
        changed = change(rng, G, c, mu)
        if not s.converged or any(
            np.abs(solved(G, c, mu, impulse=x).velocity - s.velocity).max() > 1e-9 * speed for x in starts
        ):
            continue
        unique += 1
        t = solved(*changed[:3])
        if np.abs(changed[3](t.velocity) - s.velocity).max() > 1e-9 * speed:
            elsewhere += 1
            assert np.abs(changed[3](t.velocity) - s.velocity).max() > 1e-4 * speed
            for problem, impulse in ((G, c, mu), s.impulse), (changed[:3], t.impulse):
                assert oracles.natural_map(*problem, impulse).max() <= 1e-12 * np.abs(problem[1]).max()
    assert unique >= (295 if scene == "four feet" else 150)
    assert elsewhere <= (0 if scene == "four feet" else 15)


def test_the_unit_of_mass_does_not_change_the_course_of_a_solve():
    rng = np.random.default_rng(2)
    for _ in range(20):
        G, c, mu = oracles.robot(rng, 4, 4)
        s, t = solved(G, c, mu), solved(G / 2**20, c, mu)  # a power of two: not even the rounding differs
        assert (s.sweeps, s.newton_steps) == (t.sweeps, t.newton_steps)
        np.testing.assert_array_equal(s.velocity, t.velocity)


def test_asking_for_more_does_not_give_less():
    rng = np.random.default_rng(3)
    for _ in range(20):
        p = ss.ContactProblem(*oracles.stack(rng, 3, ratio=100))
        relative = [ss.solve(p, tolerance=0, relative_tolerance=r).residual for r in (1e-6, 1e-8, 1e-10, 1e-12)]
        assert max(relative[1:]) <= relative[0] + 1e-6 * np.abs(p.free_velocity).max()
