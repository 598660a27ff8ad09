"""Independent oracles for contact problems. Nothing here calls the package, and each function has its own idea of the answer.

Arithmetic is long double (80 bits on x86): where the type is no wider than a double, `UNIT` grows and the bounds with it.
Per contact the order is x, y (tangential), z (normal); batches come first: G (N, 3, 3), c (N, 3), mu (N,).
"""

from __future__ import annotations

import itertools

import clarabel
import numpy as np
import scipy.sparse as sp

Real = np.longdouble
UNIT = float(np.finfo(np.float64).eps + np.finfo(Real).eps)  # rounding of the code under test and of the oracle
LARGEST_FRICTION = 1e4  # what infinite and huge friction counts as


def real(x) -> np.ndarray:
    return np.asarray(x, dtype=Real)


def capped(mu) -> np.ndarray:
    return np.minimum(real(mu), LARGEST_FRICTION)


def norm(x) -> np.ndarray:
    """Euclidean norm of the last axis, without overflow or underflow."""
    x = np.abs(real(x))
    largest = x.max(axis=-1, keepdims=True, initial=0)
    safe = np.where(largest > 0, largest, 1)
    return (safe * np.sqrt(((x / safe) ** 2).sum(axis=-1, keepdims=True)))[..., 0]


# Minimization by search alone ---------------------------------------------------------------------------------------


def search(f, low, high, points: int = 33, rounds: int = 60, zoom: float = 0.35):
    """Least f per problem: a grid on a box, then smaller and smaller grids around the best point so far, which may leave it.

    low, high: (N, k). f takes (N, M, k) and gives (N, M). No derivative, no structure. Returns the point (N, k) and f (N,).
    A minimum is found to about the root of the type's epsilon, its value to the epsilon.
    """
    low, high = real(low), real(high)
    k = low.shape[1]
    fine, coarse = (
        np.stack(np.meshgrid(*[np.linspace(0, 1, p)] * k, indexing="ij"), -1).reshape(-1, k) for p in (points, 7)
    )
    center, half = (low + high) / 2, (high - low) / 2
    best, value = center, np.full(len(low), np.inf, dtype=Real)
    rows = np.arange(len(low))
    for r in range(rounds):
        grid = real(fine if r == 0 else coarse) * 2 - 1
        x = center[:, None] + grid * half[:, None]
        y = f(x)
        at = np.argmin(y, axis=1)
        better = y[rows, at] < value
        best = np.where(better[:, None], x[rows, at], best)
        value = np.where(better, y[rows, at], value)
        center, half = best, half * (2 / real(points - 1) if r == 0 else zoom)
    return best, value


# The cone -----------------------------------------------------------------------------------------------------------


def project(mu, z) -> np.ndarray:
    """Nearest point of the cone |x_T| <= mu x_z: the point itself, or its shadow on the nearest generator, or 0."""
    mu, z = capped(mu), real(z)
    t = norm(z[..., :2])
    along = np.where(t[..., None] > 0, z[..., :2] / np.where(t > 0, t, 1)[..., None], 0)
    generator = np.concatenate([mu[..., None] * along, np.ones_like(z[..., :1])], -1) / np.sqrt(1 + mu**2)[..., None]
    shadow = np.maximum((generator * z).sum(-1), 0)[..., None] * generator
    inside = (z[..., 2] >= 0) & (t <= mu * z[..., 2])
    return np.where(inside[..., None], z, shadow)


def project_by_search(mu, z):
    """The same by search for the ray of the cone that comes closest: mu (N,), z (N, 3); the point and its distance."""
    mu, z = capped(mu), real(z)
    opening = np.arctan(mu)

    def ray(x):
        angle, tilt = x[..., 0], np.clip(x[..., 1], 0, opening.reshape(-1, *[1] * (x.ndim - 2)))
        return np.stack([np.sin(tilt) * np.cos(angle), np.sin(tilt) * np.sin(angle), np.cos(tilt)], -1)

    def distance(x):
        d = ray(x)
        along = (d * z[:, None]).sum(-1)[..., None]
        # A ray that points away is the worse the more it does, so that the search leaves it.
        return norm(z[:, None] - np.maximum(along, 0) * d) - np.minimum(along, 0)[..., 0]

    turn = np.full(len(z), np.pi, dtype=Real)
    x, _ = search(distance, np.stack([-turn, 0 * turn], 1), np.stack([turn, opening], 1))
    d = ray(x)
    point = np.maximum((d * z).sum(-1), 0)[:, None] * d
    return point, norm(z - point)


# Residual of Coulomb's law ------------------------------------------------------------------------------------------


def velocities(G, c, impulse) -> np.ndarray:
    """G impulse + c as (n, 3)."""
    return (real(G) @ real(impulse) + real(c)).reshape(-1, 3)


def scales(G) -> np.ndarray:
    """(n,) trace(G_ii) / 3."""
    return real(np.diagonal(G)).reshape(-1, 3).sum(1) / 3


def natural_map(G, c, mu, impulse) -> np.ndarray:
    """(n,) De Saxce's map (C3) with the allowance 4e-16 scale |impulse| that every residual contains."""
    mu, x = capped(mu), real(impulse).reshape(-1, 3)
    v, scale = velocities(G, c, impulse), scales(G)
    u = v + np.stack([0 * mu, 0 * mu, mu * norm(v[:, :2])], 1)
    sx = scale[:, None] * x
    return norm(sx - project(mu, sx - u)) + Real(4e-16) * norm(sx)


def natural_map_rounding(G, c, mu, impulse) -> np.ndarray:
    """(n,) what double arithmetic may add to or hide of (C3).

    Velocities are sums of 3 n + 1 terms. The map is nonexpansive in u = v + mu |v_T| z, so their error counts (1 + mu)
    times; the map itself is a dozen roundings of scale |impulse| and |u|.
    """
    mu, m = capped(mu), len(np.asarray(c))
    size = norm((np.abs(real(G)) @ np.abs(real(impulse)) + np.abs(real(c))).reshape(-1, 3))
    x = norm(real(impulse).reshape(-1, 3)) * scales(G)
    return UNIT * ((m + 1 + 12) * (1 + mu) * size + 12 * x)


# One contact --------------------------------------------------------------------------------------------------------


def solve3(G, b) -> np.ndarray:
    """G^-1 b for symmetric blocks (N, 3, 3), by Cramer's rule with one step of refinement."""
    G, b = real(G), real(b)
    rows = [G[:, i] for i in range(3)]
    adjugate = np.stack([np.cross(rows[1], rows[2]), np.cross(rows[2], rows[0]), np.cross(rows[0], rows[1])], 2)
    det = (rows[0] * adjugate[:, :, 0]).sum(1)[:, None]
    x = np.einsum("nij,nj->ni", adjugate, b) / det
    return x + np.einsum("nij,nj->ni", adjugate, b - np.einsum("nij,nj->ni", G, x)) / det


def sliding_impulse(G, c, mu, angle):
    """Impulse (N, M, 3) on the mantle at the angles (N, M) of its friction, with v_z = 0; NaN where the cone has none."""
    e = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], -1)
    ray = mu[:, None, None] * e + [0, 0, 1]
    push = np.einsum("nj,nmj->nm", G[:, 2], ray)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = -c[:, 2:] / push
    return np.where(z > 0, z, np.nan)[..., None] * ray


def turning(angle, G, c, mu):
    """(push) (e x v_T), e at the angles (N, M): zero where sliding is along friction. No pole: push is v_z of a unit ray."""
    e = np.stack([np.cos(angle), np.sin(angle)], 1)
    Gr = np.einsum("nij,njm->nim", G[:, :, :2], mu[:, None, None] * e) + G[:, :, 2:]
    v = Gr[:, 2:] * c[:, :2, None] - c[:, 2:, None] * Gr[:, :2]
    return e[:, 0] * v[:, 1] - e[:, 1] * v[:, 0]


def coulomb_solutions(G, c, mu, angles: int = 720) -> np.ndarray:
    """All impulses that obey Signorini's condition and Coulomb's law, (N, 6, 3): open, stick, up to four slips; NaN: none.

    Slips are the angles where the sliding velocity is along the friction, found as sign changes on a dense grid (of a
    product that has no pole), and halved until nothing changes. Two roots between grid points are found by their extremum.
    """
    G, c, mu = real(G), real(c), capped(mu)
    out = np.full((len(c), 6, 3), np.nan, dtype=Real)
    out[c[:, 2] >= 0, 0] = 0
    stick = -solve3(G, c)
    holds = (stick[:, 2] >= 0) & (norm(stick[:, :2]) <= mu * stick[:, 2])
    out[holds, 1] = stick[holds]
    smooth = (mu == 0) & (c[:, 2] < 0)
    out[smooth, 2] = np.stack([0 * mu, 0 * mu, -c[:, 2] / G[:, 2, 2]], 1)[smooth]

    pi = np.arccos(Real(-1))
    grid = np.arange(angles, dtype=Real) * (2 * pi / angles) - pi
    step = grid[1] - grid[0]
    f = turning(
        np.broadcast_to(grid, (len(c), angles)).astype(float), G.astype(float), c.astype(float), mu.astype(float)
    )
    before, after = np.roll(f, 1, 1), np.roll(f, -1, 1)
    # An extremum that comes close to zero without a sign change hides a pair of roots, if it crosses.
    dip = (np.abs(f) <= np.abs(before)) & (np.abs(f) <= np.abs(after)) & (f * before > 0) & (f * after > 0)
    i, j = np.nonzero(dip & (mu > 0)[:, None])
    sign = np.sign(f[i, j])
    at, value = search(
        lambda x: sign[:, None] * turning(x[..., 0], G[i], c[i], mu[i]),
        (grid[j] - step)[:, None],
        (grid[j] + step)[:, None],
    )
    crosses = value < 0
    ci, cj, at = i[crosses], j[crosses], at[crosses, 0]
    i, j = np.nonzero((f * after <= 0) & (mu > 0)[:, None])
    which = np.concatenate([i, ci, ci])
    low = np.concatenate([grid[j], grid[cj] - step, at])
    high = np.concatenate([grid[j] + step, at, grid[cj] + step])
    g, k, m = G[which], c[which], mu[which]
    start = turning(low[:, None], g, k, m)[:, 0]
    for _ in range(70):
        middle = (low + high) / 2
        same = turning(middle[:, None], g, k, m)[:, 0] * start > 0
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    root = (low + high) / 2
    x = sliding_impulse(g, k, m, root[:, None])[:, 0]
    v = np.einsum("nij,nj->ni", g, x) + k
    opposes = np.cos(root) * v[:, 0] + np.sin(root) * v[:, 1] <= 0  # false for NaN
    for n, impulse in zip(which[opposes], x[opposes], strict=True):
        slot = 2 + int(np.isfinite(out[n, 2:, 2]).sum())
        out[n, slot] = impulse
    return out


def energy(G, c, x) -> np.ndarray:
    """Kinetic energy of the contact point up to a constant, x' G x / 2 + c' x, for x (N, M, 3)."""
    return np.einsum("nmi,nij,nmj->nm", x, G, x) / 2 + np.einsum("nmi,ni->nm", x, c)


def dissipation_by_search(G, c, mu):
    """(N, 3) the impulse of law max_dissipation: 0 if it opens, the stop if it is in the cone, else the least energy."""
    G, c, mu = real(G), real(c), capped(mu)
    out = np.zeros_like(c)
    stick = -solve3(G, c)
    closes = c[:, 2] < 0
    holds = closes & (stick[:, 2] >= 0) & (norm(stick[:, :2]) <= mu * stick[:, 2])
    out[holds] = stick[holds]
    smooth = closes & ~holds & (mu == 0)
    out[smooth, 2] = (-c[:, 2] / G[:, 2, 2])[smooth]
    slips = closes & ~holds & (mu > 0)
    g, k, m = G[slips], c[slips], mu[slips]

    def slide_energy(x):
        e = energy(g, k, sliding_impulse(g, k, m, x[..., 0]))
        return np.where(np.isnan(e), np.inf, e)

    turn = np.full((len(k), 1), np.pi, dtype=Real)
    angle, _ = search(slide_energy, -turn, turn, points=1441)
    out[slips] = sliding_impulse(g, k, m, angle)[:, 0]
    return out


def planar_solutions(G, c, mu) -> list[np.ndarray]:
    """All impulses (2n,) of a problem in the plane, G (2n, 2n) definite, in the order x, z: one linear system per choice of
    open, stick and the two slips of each contact, 4^n of them."""
    G, c, mu, n = np.asarray(G, float), np.asarray(c, float), np.asarray(capped(mu), float), len(mu)
    out = []
    for modes in itertools.product(("open", "stick", 1, -1), repeat=n):
        # Impulses are E a: per contact none, both components, or a_z (-side mu, 1) where it slides to this side.
        columns, rows = [], []
        for i, mode in enumerate(modes):
            x, z = np.eye(2 * n)[2 * i : 2 * i + 2]
            columns += [] if mode == "open" else [x, z] if mode == "stick" else [z - mode * mu[i] * x]
            rows += [] if mode == "open" else [x, z] if mode == "stick" else [z]
        impulse = np.zeros(2 * n)
        if columns:
            E, held = np.array(columns).T, np.array(rows)
            impulse = E @ np.linalg.solve(held @ G @ E, -held @ c)
        (vx, vz), (x, z) = (G @ impulse + c).reshape(n, 2).T, impulse.reshape(n, 2).T
        side = np.array([0 if isinstance(m, str) else m for m in modes])
        if (vz >= -1e-12).all() and (z >= 0).all() and (np.abs(x) <= mu * z + 1e-12).all() and (side * vx >= 0).all():
            out.append(impulse)
    return out


# Certificate --------------------------------------------------------------------------------------------------------


def velocity_change(v, r, sticks):
    """Smallest change of the velocities v (N, 3) that makes the impulses r (N, 3) exact, by search: (N,) and the change.

    Which velocities an impulse allows: without one, those that do not approach; inside the cone (`sticks`), none; on its
    mantle, those along -r_T; without friction (r_T = 0 < r_z), those in the plane.
    """
    v, r = real(v), real(r)
    t, size = norm(r[:, :2]), norm(v)
    e = np.where(t[:, None] > 0, r[:, :2] / np.where(t > 0, t, 1)[:, None], 0)

    def allowed(x):
        plane = np.concatenate([x[..., :2], np.zeros_like(x[..., :1])], -1)
        slide = np.concatenate([-np.abs(x[..., :1]) * e[:, None], np.zeros_like(x[..., :1])], -1)
        apart = np.concatenate([x[..., :2], np.abs(x[..., 2:])], -1)
        kinds = [(r[:, 2] == 0), np.asarray(sticks), t > 0]
        return np.select([k[:, None, None] for k in kinds], [apart, 0 * x, slide], plane)

    box = np.repeat(size[:, None], 3, 1)
    x, change = search(lambda x: norm(allowed(x) - v[:, None]), -box, box, points=9, rounds=60, zoom=0.5)
    return change, allowed(x[:, None])[:, 0] - v


def certificate(G, c, mu, impulse) -> dict[str, float]:
    """The scalars of a certificate, from their definitions."""
    mu, r, v = capped(mu), real(impulse).reshape(-1, 3), velocities(G, c, impulse)
    t, speed = norm(r[:, :2]), norm(v[:, :2])
    both = (t > 0) & (speed > 0)
    cosine = -(r[both, :2] * v[both, :2]).sum(1) / (t * speed)[both]
    sine = np.abs(r[both, 0] * v[both, 1] - r[both, 1] * v[both, 0]) / (t * speed)[both]
    return {
        "penetration_speed": float(np.maximum(-v[:, 2], 0).max(initial=0)),
        "cone_violation": float(np.maximum(t - mu * r[:, 2], 0).max(initial=0)),
        "direction_error": float(np.arctan2(sine, cosine).max(initial=0)),
        "power": float(np.abs((r * v).sum(1) + mu * speed * r[:, 2]).max(initial=0)),
    }


# Conic programs -----------------------------------------------------------------------------------------------------


def conic_program(G, c, mu, fixed_normal=()) -> np.ndarray:
    """min r' G r / 2 + c' r over r_i in the cone of friction mu_i (> 0), by an interior point solver (clarabel).

    fixed_normal: contacts whose normal velocity is held at 0. Solved in units in which G and c are of order one. The
    solver ends at an energy within 1e-11 of the least, thus at velocities within 1e-5: `finish` brings them to rounding.
    """
    G, c, mu = np.asarray(G, float), np.asarray(c, float), np.asarray(capped(mu), float)
    n = len(mu)
    mass, speed = 3 * n / np.trace(G), max(np.abs(c).max(initial=0), 1e-300)
    G, c = G * mass, c / speed
    cone = sp.block_diag([[[0, 0, -m], [-1, 0, 0], [0, -1, 0]] for m in mu], format="csc")
    normal = [3 * i + 2 for i in fixed_normal]
    A = sp.vstack([sp.csc_matrix(G[normal]), cone], format="csc") if normal else cone
    b = np.concatenate([-c[normal], np.zeros(3 * n)])
    cones = ([clarabel.ZeroConeT(len(normal))] if normal else []) + [clarabel.SecondOrderConeT(3)] * n
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11  # below, it may stop far from the answer
    r = np.array(clarabel.DefaultSolver(sp.csc_matrix(np.triu(G)), c, A, b, cones, settings).solve().x)
    return finish(G, c, mu, r, normal) * speed * mass


def optimality(G, c, mu, r, normal, price):
    """What is left of the conditions r_i in K, u_i in K*, perpendicular, u = v + G_z price, and v_z = 0 where it is held."""
    v = real(G) @ real(r) + real(c)
    z = (real(r) - v - real(G)[:, normal] @ price).reshape(-1, 3)
    return np.concatenate([real(r) - project(mu, z).reshape(-1), v[normal]]), z


def finish(G, c, mu, r, normal) -> np.ndarray:
    """Newton steps on the optimality conditions of the conic program; only steps that better them are taken."""
    m, k = len(c), len(normal)
    work = (r * (G @ r + c)).reshape(-1, 3).sum(1)
    price = real([-work[j // 3] / (r[j - 2 : j + 1] @ G[j - 2 : j + 1, j]) for j in normal])
    left, z = optimality(G, c, mu, r, normal, price)
    for _ in range(20):
        D = np.zeros((m, m))
        for i, x in enumerate(z.astype(float)):
            t, slope = np.hypot(x[0], x[1]), np.sqrt(1 + mu[i] ** 2)
            if t <= mu[i] * x[2]:
                D[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = np.eye(3)
            elif mu[i] * t > -x[2]:
                e = np.array([x[0], x[1], 0]) / t
                g = (mu[i] * e + [0, 0, 1]) / slope
                turn = (g @ x) * mu[i] / slope / t * (np.diag([1, 1, 0]) - np.outer(e, e))
                D[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = np.outer(g, g) + turn
        J = np.block([[np.eye(m) - D + D @ G, D @ G[:, normal]], [G[normal], np.zeros((k, k))]])
        step = np.linalg.lstsq(J, -left.astype(float), rcond=1e-13)[0]
        new_r, new_price = real(r) + step[:m], price + step[m:]
        new_left, new_z = optimality(G, c, mu, new_r, normal, new_price)
        if not norm(new_left) < norm(left):
            break
        r, price, left, z = new_r, new_price, new_left, new_z
    return np.asarray(r, float)


# Problems -----------------------------------------------------------------------------------------------------------


def point_rows(offset) -> np.ndarray:
    """(3, 6) velocity of a point at `offset` from the origin of a body, from its linear and angular velocity."""
    x, y, z = offset
    return np.hstack([np.eye(3), [[0, z, -y], [-z, 0, x], [y, -x, 0]]])


def robot(rng, feet: int = 4, corners: int = 0, friction=None):
    """(G, c, mu) of a walking robot at impact: feet on legs of three joints, corners on the body itself."""
    n = feet + corners
    J = np.zeros((3 * n, 6 + 3 * feet))
    for i in range(n):
        at = [rng.choice([-0.3, 0.3]) + rng.normal() * 0.05, rng.choice([-0.15, 0.15]) + rng.normal() * 0.03, -0.1]
        if i < feet:
            at[2] = -0.5 + 0.05 * rng.normal()
            J[3 * i : 3 * i + 3, 6 + 3 * i : 9 + 3 * i] = rng.normal(size=(3, 3)) * 0.3
        J[3 * i : 3 * i + 3, :6] = point_rows(at)
    mass = np.concatenate([[25] * 3, rng.uniform([0.4, 1, 1], [0.8, 2, 2]), rng.uniform(0.02, 0.2, 3 * feet)])
    G = (J / mass) @ J.T
    u = rng.normal(size=len(mass)) * 0.5
    u[2] -= 1
    return (G + G.T) / 2, J @ u, rng.uniform(0.2, 0.9, n) if friction is None else np.full(n, float(friction))


def stack(rng, boxes: int = 1, ratio: float = 1, friction=None):
    """(G, c, mu) of a pile of boxes, each on the one below, four corners per face; masses grow by `ratio` upwards."""
    J, size = np.zeros((12 * boxes, 6 * boxes)), 0.2
    mass = np.repeat(ratio ** np.arange(boxes, dtype=float), 6)
    mass.reshape(-1, 6)[:, 3:] *= size**2 / 6
    for i in range(boxes):
        for k in range(4):
            rows = slice(12 * i + 3 * k, 12 * i + 3 * k + 3)
            x, y = size / 2 * (1 if k & 1 else -1), size / 2 * (1 if k & 2 else -1)
            J[rows, 6 * i : 6 * i + 6] = point_rows([x, y, -size / 2])
            if i:
                J[rows, 6 * i - 6 : 6 * i] = -point_rows([x, y, size / 2])
    G = (J / mass) @ J.T
    u = rng.normal(size=6 * boxes) * 0.3
    u[2::6] -= 1
    n = 4 * boxes
    return (G + G.T) / 2, J @ u, np.full(n, rng.uniform(0.2, 0.9) if friction is None else float(friction))


FAMILIES = ("near diagonal", "Wishart", "robot foot", "ill-conditioned")


def single_contacts(rng, family: str, count: int):
    """(G, c, mu) of single contacts (N, 3, 3): a third opens, a third is made to stick, the rest mostly slides."""
    mu = rng.uniform(0.1, 1.2, count)
    if family == "near diagonal":
        A = rng.normal(size=(count, 3, 3)) * 0.2
        G = A @ A.transpose(0, 2, 1) + rng.uniform(0.5, 2, (count, 1, 3)) * np.eye(3)
        G[:, 0, 0] = G[:, 1, 1] = (G[:, 0, 0] + G[:, 1, 1]) / 2
    elif family == "Wishart":
        A = rng.normal(size=(count, 3, 6))
        G = A @ A.transpose(0, 2, 1) / 6
    elif family == "robot foot":
        G = np.array([robot(rng, feet=1)[0] for _ in range(count)])
    else:
        Q, _ = np.linalg.qr(rng.normal(size=(count, 3, 3)))
        G = (Q * 10 ** rng.uniform(-6, 0, (count, 1, 3))) @ Q.transpose(0, 2, 1)
        mu = 10 ** rng.uniform(-1.5, 0.5, count)
    G = (G + G.transpose(0, 2, 1)) / 2
    c = rng.normal(size=(count, 3))
    kind = np.arange(count) % 3
    c[:, 2] = np.where(kind == 0, 1, -1) * np.abs(c[:, 2])
    inside = rng.normal(size=(count, 3))
    inside[:, :2] *= (mu * rng.uniform(0, 0.99, count) / np.hypot(inside[:, 0], inside[:, 1]))[:, None]
    inside[:, 2] = 1
    return G, np.where((kind == 1)[:, None], -np.einsum("nij,nj->ni", G, inside), c), mu
