"""What holds for every contact problem, whatever its conditioning, friction and units: no exception, no NaN, a true status.

The residual that judges a status is the long double one of oracles.py. The second half changes a problem in ways that must not
matter (order of contacts, units, directions of the tangential axes) and expects the same velocity.
"""

from __future__ import annotations

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

import oracles
import stickslip as ss
from oracles import Real, norm

FRICTION = st.one_of(st.sampled_from([0.0, 0.3, 0.8, 1e6, np.inf]), st.floats(1e-12, 3), st.floats(1e-12, 1e9))


@st.composite
def problems(draw):
    """A problem of 1 to 6 contacts, G = Y Y^T with rows as unlike as 1e8 to 1, any rank and any units."""
    n = draw(st.integers(1, 6))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    rank = draw(st.integers(1, 3 * n + 2))
    Y = rng.normal(size=(3 * n, rank)) * 10 ** (rng.uniform(-1, 0, rank) * draw(st.sampled_from([0, 0, 3, 8])))
    Y *= 10 ** (rng.uniform(-1, 0, (3 * n, 1)) * draw(st.sampled_from([0, 0, 0, 3, 8])))
    if draw(st.booleans()) and n > 1:  # duplicated contacts
        Y[3:6] = Y[:3]
    if draw(st.integers(0, 7)) == 0:  # a plane problem
        Y[1::3] = 0
    if draw(st.integers(0, 7)) == 0:  # rows that nothing moves
        Y[rng.random(3 * n) < 0.3] = 0
    kind = draw(st.sampled_from(["in the range"] * 4 + ["any"] * 2 + ["zero"]))
    c = {"in the range": Y @ rng.normal(size=rank), "any": rng.normal(size=3 * n), "zero": np.zeros(3 * n)}[kind]
    c *= -1 if c[2::3].sum() > 0 else 1  # most problems push
    mass, length, time = (10 ** draw(st.sampled_from([-12, -6, -1, 0, 0, 0, 1, 6, 12])) for _ in range(3))
    G = Y @ Y.T / mass
    mu = np.array([draw(FRICTION) for _ in range(n)]) if draw(st.booleans()) else np.full(n, draw(FRICTION))
    return ss.ContactProblem((G + G.T) / 2, c * (length / time), mu)


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
    x, mu = impulse.reshape(-1, 3), np.minimum(p.friction, 1e4)
    t = np.hypot(x[:, 0], x[:, 1])
    assert (x[:, 2] >= 0).all(), x
    assert (t <= mu * x[:, 2] * (1 + 1e-14)).all(), f"{x} leaves the cones of {mu}"


def check_max_dissipation(p: ss.ContactProblem, s: ss.ContactSolution, limit: float):
    """What the law implies at each contact of a solved problem: it opens, it stays, or it cannot push."""
    size = norm((np.abs(p.delassus) @ np.abs(s.impulse) + np.abs(p.free_velocity)).reshape(-1, 3))
    v, x = oracles.velocities(p.delassus, p.free_velocity, s.impulse), s.impulse.reshape(-1, 3)
    for i in range(p.num_contacts):
        block = p.delassus[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        own = block.astype(Real) @ x[i]
        allowed = limit * (1 + 1e-6) + 1e-10 * norm(v[i] - own) + 100 * oracles.UNIT * size[i]
        opens = norm(own) <= allowed and v[i, 2] - own[2] >= -allowed
        stays = abs(v[i, 2]) <= allowed
        idle = block[2, 2] <= 1e-12 * np.trace(block) and norm(own) <= allowed
        assert v[i, 2] >= -allowed and (opens or stays or idle), f"contact {i}: v = {v[i]}, impulse = {x[i]}"


@hypothesis.given(
    p=problems(),
    choice=st.sampled_from(CHOICES),
    limits=st.sampled_from(LIMITS),
)
@hypothesis.settings(max_examples=1200, deadline=None, derandomize=True)
def test_every_method_answers_every_problem_with_a_true_status(p, choice, limits):
    method, law = choice
    tolerance, relative = limits
    limit = tolerance + relative * np.abs(p.free_velocity).max()
    s = ss.solve(p, method=method, law=law, tolerance=tolerance, relative_tolerance=relative, max_sweeps=100)
    for a in (s.impulse, s.velocity, s.contact_residuals, [s.residual]):
        assert np.isfinite(a).all()
    check_cones(p, s.impulse)
    np.testing.assert_array_equal(s.contact_residuals, ss.residual(p, s.impulse, law=law))
    assert s.residual == s.contact_residuals.max()
    if method != "auto":  # the start counts as found
        assert s.residual <= ss.residual(p, np.zeros(3 * p.num_contacts), law=law).max()
    assert s.converged == (s.residual <= limit) == (s.status == "converged")
    if s.status == "infeasible":
        blocks = np.diagonal(p.delassus).reshape(-1, 3)
        assert ((blocks[:, 2] <= 1e-12 * blocks.sum(1)) & (s.velocity[2::3] < 0)).any()
    if law == "max_dissipation":
        if s.converged:
            check_max_dissipation(p, s, limit)
        return
    args = (p.delassus, p.free_velocity, p.friction, s.impulse)
    exact, rounding = oracles.natural_map(*args), oracles.natural_map_rounding(*args)
    assert (np.abs(exact - s.contact_residuals) <= rounding).all()
    if s.converged:
        assert (exact <= limit * (1 + 1e-6) + rounding).all()
    else:
        assert (exact >= limit * (1 - 1e-6) - rounding).any()


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


@pytest.mark.parametrize("change", [permuted, turned, in_other_units])
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


def test_a_problem_without_a_solution_gets_nothing_worse_than_no_impulse():
    """A rail that jams: the contact moves along one line only, and friction holds it there while it is driven in."""
    line = np.array([1.45, 0.54, 0.33])
    p = ss.ContactProblem(np.outer(line, line), [1.0421, -0.6304, -1.0035], [1.123])
    s = ss.solve(p)
    assert not s.converged
    assert s.residual <= ss.residual(p, np.zeros(3)).max()
