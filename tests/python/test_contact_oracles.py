"""Contact residuals, laws and certificates against oracles that share no code with the package (oracles.py).

Bounds are derived where rounding is all that differs (`natural_map_rounding`); elsewhere they are the tolerance of the oracle.
"""

from __future__ import annotations

import numpy as np
import pytest

import oracles
import stickslip as ss
from oracles import Real, norm

EXTREME_FRICTION = [0, 1e-3, 0.5, 1, 30, 1e4, 1e6, np.inf]


def impulses_of_every_kind(rng, mu: np.ndarray, size: float) -> np.ndarray:
    """(n, 3): nothing, on the mantle of the cone, below the ground, or anywhere."""
    x = rng.normal(size=(len(mu), 3)) * size
    for i, kind in enumerate(rng.integers(4, size=len(mu))):
        if kind == 0:
            x[i] = 0
        elif kind == 1:
            angle, x[i, 2] = rng.uniform(-np.pi, np.pi), abs(x[i, 2])
            x[i, :2] = min(mu[i], 1e4) * x[i, 2] * np.array([np.cos(angle), np.sin(angle)])
        elif kind == 2:
            x[i, 2] = -abs(x[i, 2])
    return x


def problem_of_any_scale(rng):
    """(G, c, mu, impulse): 1 to 4 contacts, any rank, units anywhere between 1e-9 and 1e9, now and then a zero block."""
    n = int(rng.integers(1, 5))
    Y = rng.normal(size=(3 * n, int(rng.integers(1, 3 * n + 3)))) * 10 ** rng.uniform(-2, 2, (3 * n, 1))
    if rng.random() < 0.1:
        Y[:3] = 0
    mass, speed = 10 ** rng.uniform(-9, 9, 2)
    G = Y @ Y.T / mass
    mu = np.where(rng.random(n) < 0.5, rng.choice(EXTREME_FRICTION, n), 10 ** rng.uniform(-2, 1, n))
    c = rng.normal(size=3 * n) * speed * (rng.random() < 0.9)
    x = impulses_of_every_kind(rng, mu, speed * mass * 10 ** rng.uniform(-3, 3))
    return (G + G.T) / 2, c, mu, x.reshape(-1)


def test_the_residual_is_the_natural_map_in_long_double_at_every_scale():
    rng = np.random.default_rng(1)
    kinds = np.zeros(3, int)
    for k in range(3000):
        G, c, mu, x = problem_of_any_scale(rng)
        e = ss.residual(ss.ContactProblem(G, c, mu), x)
        exact, rounding = oracles.natural_map(G, c, mu, x), oracles.natural_map_rounding(G, c, mu, x)
        assert (np.abs(e - exact) <= rounding).all(), f"case {k}: {e} is not {exact} to {rounding}"
        kinds += [
            (x == 0).any(),
            (np.asarray(scale := oracles.scales(G)) == 0).any(),
            (e > 1e3 * rounding)[scale > 0].any(),
        ]
    assert (kinds > [700, 80, 2200]).all(), (
        kinds
    )  # the sample has what it claims, and most residuals stand out of rounding


def test_the_residual_projects_on_the_nearest_point_of_the_cone():
    rng = np.random.default_rng(2)
    mu = np.where(rng.random(300) < 0.3, rng.choice(EXTREME_FRICTION, 300), 10 ** rng.uniform(-2, 2, 300))
    z = rng.normal(size=(300, 3))
    z[: len(z) // 4, 2] *= 1e-3
    point, distance = oracles.project_by_search(mu, z)
    assert np.abs(norm(z - oracles.project(mu, z)) - distance).max() < 1e-15
    assert norm(oracles.project(mu, z) - point).max() < 1e-8
    # With G = 1 and c = -z the impulse z stops the contact, and the residual is its distance from the cone.
    for m, x, d in zip(mu, z, distance, strict=True):
        e = ss.residual(ss.ContactProblem(np.eye(3), -x, [m]), x)[0]
        assert abs(e - d) <= 8 * oracles.UNIT * (1 + norm(x)), (m, x, e, d)
    assert (distance < 1e-15).sum() > 30 and (distance > 0.1).sum() > 100


@pytest.mark.parametrize("family", oracles.FAMILIES)
def test_one_contact_gets_one_of_the_solutions_of_coulombs_law(family):
    G, c, mu = oracles.single_contacts(np.random.default_rng(3), family, 2000)
    solutions = oracles.coulomb_solutions(G, c, mu)
    assert np.isfinite(solutions[:, :, 2]).any(axis=1).all()  # Coulomb's law has a solution where G is definite
    for method, failures in {"halley": 0, "bisection": 0, "quartic": 20}.items():
        kinds = np.zeros(3, int)
        failed = 0
        for g, k, m, known in zip(G, c, mu, solutions, strict=True):
            try:
                x = ss.solve_contact(g, k, m, method=method, tolerance=1e-12)
            except ArithmeticError:
                failed += 1
                continue
            apart = np.where(np.isnan(known[:, 2]), np.inf, norm((known - x) @ g)) / norm(k)
            nearest = int(np.argmin(apart))
            assert apart[nearest] < 1e-10, f"{method}: {x} is none of {known} for G = {g}, c = {k}, mu = {m}"
            kinds[min(nearest, 2)] += 1
        assert failed <= failures
        assert (kinds >= 0.15 * len(c)).all(), f"{method}: open, stick, slip {kinds}"


@pytest.mark.parametrize("family", oracles.FAMILIES)
def test_a_closing_contact_has_one_solution_under_the_bound_of_the_theory_page(family):
    G, c, mu = oracles.single_contacts(np.random.default_rng(4), family, 1500)
    G, c, mu = (x[c[:, 2] < 0] for x in (G, c, mu))
    S = G[:, :2, :2] - G[:, :2, 2:] * G[:, 2:, :2] / G[:, 2:, 2:]
    condition = np.linalg.cond(S)
    unique = mu * np.hypot(*(G[:, :2, 2] / G[:, 2:, 2]).T) < 2 * np.sqrt(condition) / (1 + condition)
    count = np.isfinite(oracles.coulomb_solutions(G, c, mu)[:, :, 2]).sum(axis=1)
    assert unique.sum() > 0.1 * len(c)
    assert (count[unique] == 1).all() and (count >= 1).all()


@pytest.mark.parametrize("family", oracles.FAMILIES)
def test_maximum_dissipation_is_the_conic_program(family):
    G, c, mu = oracles.single_contacts(np.random.default_rng(5), family, 600)
    searched = oracles.dissipation_by_search(G, c, mu)
    accuracy = 1e-6 if family == "ill-conditioned" else 1e-8  # of a search among energies
    finished = failed = 0
    for g, k, m, s in zip(G, c, mu, searched, strict=True):
        p, speed = ss.ContactProblem(g, k, [m]), norm(k)
        x = ss.solve_contact(g, k, m, law="max_dissipation", tolerance=1e-13)
        assert norm(g @ (x - s)) <= accuracy * speed
        for method, looser in {"bisection": 1, "golden_section": 100, "quartic": 1}.items():
            try:
                y = ss.solve_contact(g, k, m, law="max_dissipation", method=method, tolerance=1e-11 * looser**2)
                assert norm(g @ (y - s)) <= looser * accuracy * speed, (method, g, k, m)
            except ArithmeticError:
                assert method != "bisection"  # the others may fail, and say so
                failed += 1
        assert ss.residual(p, s, law="max_dissipation")[0] <= accuracy * speed
        if k[2] >= 0:
            assert not x.any()
            continue
        conic = oracles.conic_program(g, k, [m], fixed_normal=[0])
        apart = norm(g @ (conic - x)) / speed
        assert apart <= 1e-4, f"the conic program has {conic}, not {x} for G = {g}, c = {k}, mu = {m}"
        finished += apart < 1e-10
        assert abs(ss.residual(p, conic, law="max_dissipation")[0] / speed - apart) <= 1e-11 + 1e-15 * norm(
            conic
        ) * np.trace(g)
    assert failed <= 0.25 * len(c)
    assert finished > 0.9 * (c[:, 2] < 0).sum()


def test_the_residual_of_maximum_dissipation_is_the_distance_from_the_local_solution():
    rng = np.random.default_rng(6)
    for k in range(250):
        G, c, mu = oracles.robot(rng, feet=int(rng.integers(1, 5)))
        mu[rng.random(len(mu)) < 0.1] = 0
        x = impulses_of_every_kind(rng, mu, 3.0).reshape(-1)
        n = len(mu)
        blocks = np.array([G[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in range(n)])
        rest = oracles.velocities(G, c, x) - np.einsum("nij,nj->ni", blocks.astype(Real), x.reshape(-1, 3))
        local = oracles.dissipation_by_search(blocks, rest, mu)
        expected = norm(np.einsum("nij,nj->ni", blocks.astype(Real), x.reshape(-1, 3) - local))
        e = ss.residual(ss.ContactProblem(G, c, mu), x, law="max_dissipation")
        assert (np.abs(e - expected) <= 1e-8 * norm(rest)).all(), f"case {k}: {e} is not {expected}"


MANY_CONTACTS = {
    "two feet": lambda rng: oracles.robot(rng, 2),
    "four feet": lambda rng: oracles.robot(rng, 4),
    "four feet and two corners": lambda rng: oracles.robot(rng, 4, 2, friction=rng.uniform(0.1, 0.5)),
    "a box": lambda rng: oracles.stack(rng, 1),
    "two boxes": lambda rng: oracles.stack(rng, 2),
    "three boxes": lambda rng: oracles.stack(rng, 3),
    "three boxes, each 30 times as heavy as the one below": lambda rng: oracles.stack(rng, 3, ratio=30),
}


@pytest.mark.parametrize("scene", MANY_CONTACTS)
def test_the_convex_model_solves_coulombs_law_for_the_shifted_velocity(scene):
    """Anitescu's model is Coulomb's law with c_z less by mu |v_T|, so a conic program is an oracle for many contacts."""
    rng = np.random.default_rng(7)
    count, exact, same, solved = 60, 0, 0, 0
    for _ in range(count):
        G, c, mu = MANY_CONTACTS[scene](rng)
        r = oracles.conic_program(G, c, mu)
        shifted = c.copy()
        shifted[2::3] -= np.asarray(mu * norm(oracles.velocities(G, c, r)[:, :2]), float)
        p, speed = ss.ContactProblem(G, shifted, mu), np.abs(shifted).max()
        e = ss.residual(p, r).max()
        assert e <= 1e-4 * speed  # what an interior point solver reaches where the last steps do not finish
        if e > 1e-10 * speed:
            continue
        exact += 1
        s = ss.solve(p, tolerance=1e-12 * speed)
        solved += s.residual <= 1e-8 * speed
        exactly, rounding = (f(G, shifted, mu, s.impulse) for f in (oracles.natural_map, oracles.natural_map_rounding))
        assert (np.abs(s.contact_residuals - exactly) <= rounding).all()
        same += np.abs(s.velocity - G @ r - shifted).max() <= 1e-8 * speed
    assert exact >= 0.9 * count
    assert solved == exact
    # Coulomb's law may have several solutions where body corners and feet share the load; few problems do.
    assert same >= 0.9 * exact


def impulses_on_the_cone(rng, mu: np.ndarray):
    """(n, 3) impulses and whether each lies inside its cone: nothing, inside, and on the mantle."""
    n = len(mu)
    kind, angle, z = rng.integers(3, size=n), rng.uniform(-np.pi, np.pi, n), rng.uniform(0.1, 2, n)
    share = np.where(kind == 1, rng.uniform(0, 0.99, n), 1)
    t = np.minimum(mu, 1e4) * z * share
    x = np.stack([t * np.cos(angle), t * np.sin(angle), z], 1) * (kind > 0)[:, None]
    return x, (kind == 1) & (mu > 0)


def test_the_backward_error_is_the_smallest_change_of_velocity_that_makes_an_impulse_exact():
    rng = np.random.default_rng(8)
    cases = []
    for _ in range(80):
        n = int(rng.integers(1, 5))
        Y = rng.normal(size=(3 * n, int(rng.integers(1, 3 * n + 3))))
        mu = np.where(rng.random(n) < 0.25, rng.choice([0, 1e4, 1e6, np.inf], n), rng.uniform(0.05, 2, n))
        x, sticks = impulses_on_the_cone(rng, mu)
        p = ss.ContactProblem(Y @ Y.T, rng.normal(size=3 * n) * 3, mu)
        certificate = ss.certify(p, x.reshape(-1))
        v = oracles.velocities(p.delassus, p.free_velocity, x.reshape(-1))
        assert certificate.backward_error == certificate.backward_errors.max()
        # The natural map is nonexpansive in v + mu |v_T| z.
        bound = (1 + np.minimum(mu, 1e4)) * certificate.backward_errors
        rounding = 4 * oracles.natural_map_rounding(p.delassus, p.free_velocity, mu, x.reshape(-1))
        assert (certificate.residuals <= bound + rounding).all()
        cases.append((certificate.backward_errors, v, x, sticks, mu))
    error, v, x, sticks, mu = (np.concatenate(a) for a in zip(*cases, strict=True))
    expected, change = oracles.velocity_change(v, x, sticks)
    assert np.abs(error - expected).max() <= 1e-13 * (1 + norm(x) * mu.clip(max=1e4)).max()
    # With that change the impulse is exact, with any smaller one it is not.
    identity, rng = np.eye(3), np.random.default_rng(9)
    for w, d, r, m, e in zip(v, change, x, mu, error, strict=True):
        rounding = 1e-13 * (1 + norm(r) + norm(w)) * (1 + min(m, 1e4))
        assert oracles.natural_map(identity, w + d - r, [m], r)[0] <= rounding
        other = rng.normal(size=(5, 3))
        for k in 0.9 * e * other / norm(other)[:, None]:
            assert e < 1e-6 or oracles.natural_map(identity, w + k - r, [m], r)[0] > rounding


def test_the_numbers_of_a_certificate_are_their_definitions():
    rng = np.random.default_rng(10)
    for _ in range(1000):
        G, c, mu, x = problem_of_any_scale(rng)
        certificate = ss.certify(ss.ContactProblem(G, c, mu), x)
        size = np.abs(np.asarray(G)) @ np.abs(x) + np.abs(c)
        m = np.minimum(mu, 1e4)
        # Velocities are sums of 3 n + 1 terms; power is their product with impulses, friction speeds counted mu times.
        rounding = {
            "penetration_speed": 20 * oracles.UNIT * size.max(),
            "cone_violation": 8 * oracles.UNIT * (np.abs(x).reshape(-1, 3).max(1) * (1 + m)).max(),
            "power": 60
            * oracles.UNIT
            * ((1 + m) * (np.abs(x) * 1).reshape(-1, 3).max(1) * size.reshape(-1, 3).max(1)).max(),
        }
        expected = oracles.certificate(G, c, mu, x)
        for name, allowed in rounding.items():
            assert abs(getattr(certificate, name) - expected[name]) <= allowed, (name, certificate, expected)
        np.testing.assert_array_equal(certificate.residuals, ss.residual(ss.ContactProblem(G, c, mu), x))
        assert certificate.residual == certificate.residuals.max()


def test_the_direction_error_is_the_angle_between_friction_and_the_opposite_of_sliding():
    rng = np.random.default_rng(11)
    for _ in range(500):
        G, c, mu = oracles.robot(rng, feet=int(rng.integers(1, 5)))
        x = np.abs(rng.normal(size=3 * len(mu)))
        certificate = ss.certify(ss.ContactProblem(G, c, mu), x)
        expected = oracles.certificate(G, c, mu, x)["direction_error"]
        assert certificate.direction_error == pytest.approx(expected, abs=1e-12)
        assert 0 <= certificate.direction_error <= np.pi
