"""Generated contact problems: a seed is a problem, physics says rank and weights, NumPy builds the stacks again."""

import numpy as np
import pytest

import stickslip as ss
from stickslip import _core, problems

GRAVITY, STEP = 9.81, 1e-3
REST = {"push": (0, 0), "noise": 0}  # a stack that nothing but gravity moves


def dense(p: ss.ContactProblem) -> np.ndarray:
    return p.dense_delassus()


def bits(p: ss.ContactProblem) -> bytes:
    return dense(p).tobytes() + p.free_velocity.tobytes() + p.friction.tobytes()


def spectrum(G: np.ndarray, cutoff: float = 1e-11) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues over the largest, and the eigenvectors of those above the cutoff."""
    values, vectors = np.linalg.eigh(G)
    values = values / values[-1]
    return values, vectors[:, values > cutoff]


def cube_stack(masses, size: float, push) -> tuple[np.ndarray, np.ndarray]:
    """J M^-1 J^T and J u_free of a stack of cubes, straight from the definition."""
    n = len(masses)
    M = np.diag(np.concatenate([[m] * 3 + [m * size**2 / 6] * 3 for m in masses]))
    rows = []
    for i in range(n):
        for y in (-size / 2, size / 2):
            for x in (-size / 2, size / 2):
                J = np.zeros((3, 6 * n))
                for body, z, sign in ((i, -size / 2, 1), (i - 1, size / 2, -1)):
                    if body >= 0:
                        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])  # [r]x, v + w x r = v - [r]x w
                        J[:, 6 * body : 6 * body + 6] = sign * np.hstack([np.eye(3), -cross])
                rows.append(J)
    J = np.vstack(rows)
    force = np.zeros(6 * n)
    force[-6:-4] = push
    force[2::6] = -GRAVITY * np.array(masses)
    return J @ np.linalg.solve(M, J.T), J @ np.linalg.solve(M, STEP * force)


@pytest.mark.parametrize("family", problems.FAMILIES)
def test_a_seed_is_a_problem(family):
    make = problems.FAMILIES[family]
    assert bits(make(seed=3)) == bits(make(seed=3))
    assert bits(make(seed=3)) != bits(make(seed=4))
    first, second = problems.generate(family, 2, seed=3)
    assert bits(first) == bits(make(seed=3)) and bits(second) == bits(make(seed=4))


@pytest.mark.parametrize("family", problems.FAMILIES)
def test_python_and_cpp_have_the_same_families_and_defaults(family):
    assert list(problems.FAMILIES) == _core.problems.family_names()
    for seed in range(3):
        core = problems._problem(_core.problems.random_problem(family, seed))
        assert bits(core) == bits(problems.FAMILIES[family](seed))


@pytest.mark.parametrize("family", problems.FAMILIES)
def test_matrices_are_symmetric_semidefinite_and_hold_the_free_velocity(family):
    options = {"condition": 1e6} if family == "ill_conditioned" else {}
    for p in problems.generate(family, 3, **options):
        G, c = dense(p), p.free_velocity
        assert (G == G.T).all()
        values, vectors = spectrum(G)
        assert values[0] > -1e-13
        np.testing.assert_allclose(vectors @ (vectors.T @ c), c, atol=1e-12 * abs(c).max())
        assert abs(c).max() > 0 and (p.friction == p.friction[0]).all()


@pytest.mark.parametrize(
    ("family", "contacts", "rank"),
    [
        ("quadruped_standing", [4], 12),
        ("quadruped_trotting", [2, 3, 4], 12),
        ("quadruped_impact", [4], 12),
        ("eight_contacts_resting", [8], 18),
        ("eight_contacts_impact", [8], 18),
    ],
)
def test_a_quadruped_has_18_degrees_of_freedom(family, contacts, rank):
    seen = set()
    for p in problems.generate(family, 30):
        seen.add(p.num_contacts)
        _, vectors = spectrum(p.delassus)
        assert vectors.shape[1] == min(rank, 3 * p.num_contacts)
        assert 0.3 <= p.friction[0] < 1
    assert seen == set(contacts)


def test_a_landing_quadruped_falls_and_a_standing_one_hardly_moves():
    landing = np.array([p.free_velocity for p in problems.generate("quadruped_impact", 100)])
    standing = np.array([p.free_velocity for p in problems.generate("quadruped_standing", 100)])
    trotting = np.array([p.free_velocity[:2] for p in problems.generate("quadruped_trotting", 100)])
    assert np.mean(landing[:, 2::3]) == pytest.approx(-3, abs=0.4)
    assert abs(np.mean(standing[:, 2::3])) < 0.1 and np.std(standing) < 1
    np.testing.assert_allclose(trotting.mean(axis=0), [1.5, 0], atol=0.3)


@pytest.mark.parametrize("push", [(0, 0), (3, -1)])
@pytest.mark.parametrize("heavy", ["top", "bottom", "alternating"])
def test_a_box_stack_is_what_numpy_builds(heavy, push):
    masses = {"top": [1, 1, 1, 1e3], "bottom": [1e3, 1, 1, 1], "alternating": [1, 1e3, 1, 1e3]}[heavy]
    p = problems.box_stack(seed=5, num_boxes=4, mass_ratio=1e3, heavy=heavy, size=0.3, push=push, noise=0, friction=0.6)
    G, c = cube_stack(masses, 0.3, push)
    np.testing.assert_allclose(p.delassus, G, rtol=1e-12, atol=1e-12 * abs(G).max())
    np.testing.assert_allclose(p.free_velocity, c, rtol=1e-12, atol=1e-12 * abs(c).max())
    np.testing.assert_array_equal(p.friction, np.full(16, 0.6))


def test_stacks_of_a_seed_vary_and_noise_shakes_them():
    sizes = [p.num_contacts for p in problems.generate("box_stack", 60)]
    assert set(sizes) == {8, 12, 16, 20}
    drawn = list(problems.generate("box_stack", 60, num_boxes=2))
    still = problems.box_stack(num_boxes=2, **REST).free_velocity
    at_rest = sum(np.allclose(p.free_velocity, still, atol=1e-15) for p in drawn)
    assert 5 < at_rest < 30  # neither pushed nor shaken: a quarter of them
    shaken = np.array(
        [p.free_velocity - still for p in problems.generate("box_stack", 300, num_boxes=2, push=(0, 0), noise=0.01)]
    )
    # v + w x r at (-0.1, -0.1, -0.1): z moves by noise (1, -y / size, x / size)
    assert np.std(shaken[:, 2]) == pytest.approx(0.01 * np.sqrt(1.5), rel=0.15)


@pytest.mark.parametrize("heavy", ["top", "bottom", "alternating"])
def test_each_interface_of_a_resting_stack_carries_the_weight_above(heavy):
    masses = np.array({"top": [1, 1, 100], "bottom": [100, 1, 1], "alternating": [1, 100, 1]}[heavy])
    p = problems.box_stack(num_boxes=3, mass_ratio=100, heavy=heavy, friction=0.5, **REST)
    s = ss.solve(p, tolerance=1e-10)
    assert s.converged
    carried = s.impulse[2::3].reshape(3, 4).sum(axis=1)
    weight = masses[::-1].cumsum()[::-1] * GRAVITY * STEP
    np.testing.assert_allclose(carried, weight, rtol=1e-6)


def test_the_ground_carries_a_wall():
    p = problems.brick_wall(rows=3, columns=3, noise=0, friction=0.7)
    s = ss.solve(p)
    assert s.converged
    assert s.impulse[2:36:3].sum() == pytest.approx(9 * GRAVITY * STEP, rel=1e-5)


def test_the_ground_carries_a_pile():
    # 45 contacts of 14 spheres; the ground's are those that fall freely along their normal
    p = problems.sphere_pile(layers=3, noise=0, irregularity=0, friction=0.9)
    s = ss.solve(p)
    assert s.converged
    on_ground = p.free_velocity[2::3] < -0.9 * GRAVITY * STEP
    assert on_ground.sum() == 9
    assert s.impulse[2::3][on_ground].sum() == pytest.approx(14 * GRAVITY * STEP, rel=1e-5)


def test_mass_ratios_scale_the_boxes_that_are_heavy():
    light = problems.box_stack(num_boxes=2, **REST)
    heavy = problems.box_stack(num_boxes=2, mass_ratio=1e6, heavy="bottom", **REST)
    np.testing.assert_allclose(heavy.delassus[:12, :12], light.delassus[:12, :12] / 1e6, rtol=1e-12, atol=1e-18)
    # between the boxes, the heavy one hardly yields: half of what two light ones do
    np.testing.assert_allclose(heavy.delassus.diagonal()[12:], light.delassus.diagonal()[12:] / 2, rtol=2e-6)
    for family in ("sphere_pile", "brick_wall"):
        spread = []
        for ratio in (1, 1e6):
            diagonal = dense(problems.FAMILIES[family](1, mass_ratio=ratio)).diagonal()
            spread.append(diagonal.max() / diagonal.min())
        assert spread[1] > 1e3 * spread[0]


def test_copies_repeat_the_contacts_of_their_base():
    for base in ("quadruped_impact", "box_stack"):
        p, d = problems.FAMILIES[base](7), problems.duplicated_contacts(7, base=base, copies=3)
        rows = np.arange(3 * p.num_contacts).reshape(-1, 3).repeat(3, axis=0).ravel()
        np.testing.assert_array_equal(d.delassus, p.delassus[np.ix_(rows, rows)])
        np.testing.assert_array_equal(d.free_velocity, p.free_velocity[rows])
        np.testing.assert_array_equal(d.friction, p.friction.repeat(3))
    assert problems.duplicated_contacts(0, base="quadruped_standing", friction=0.125).friction[0] == 0.125
    assert {problems.duplicated_contacts(s, base="quadruped_impact").num_contacts for s in range(20)} == {8, 16}


@pytest.mark.parametrize(("condition", "rank"), [(1, 12), (1e3, 7), (1e6, 12), (1e12, 9), (1e12, 12)])
def test_ill_conditioned_matrices_have_their_condition_and_rank(condition, rank):
    p = problems.ill_conditioned(1, num_contacts=4, condition=condition, rank=rank)
    values, _ = spectrum(p.delassus)
    assert p.delassus.shape == (12, 12)
    assert values[-rank] == pytest.approx(1 / condition, rel=1e-3)
    assert abs(values[: 12 - rank]).max(initial=0) < 1e-15 * 12
    assert np.linalg.eigvalsh(p.delassus)[-1] == pytest.approx(1)


def test_a_motion_lifts_all_contacts_of_ill_conditioned_problems():
    lift = np.tile([0, 0, 1], 4)
    for p in problems.generate("ill_conditioned", 10, num_contacts=4, rank=3, condition=1e4):
        _, vectors = spectrum(p.delassus, 1e-6)
        np.testing.assert_allclose(vectors @ (vectors.T @ lift), lift, atol=1e-9)


def test_walls_and_piles_have_as_many_contacts_as_geometry_says():
    for rows, columns in [(1, 3), (2, 1), (4, 5)]:
        assert problems.brick_wall(rows=rows, columns=columns).num_contacts == 4 * columns * (2 * rows - 1)
    # ground, spheres on four others, neighbors in a layer
    assert problems.sphere_pile(layers=3, irregularity=0).num_contacts == 9 + 4 * (4 + 1) + (12 + 4)
    irregular = {problems.sphere_pile(s, layers=3).num_contacts for s in range(8)}
    assert min(irregular) >= 29 and max(irregular) <= 45 and len(irregular) > 3


def test_large_families_are_block_sparse():
    p = problems.brick_wall(rows=6, columns=5)
    blocks = abs(dense(p)).reshape(p.num_contacts, 3, p.num_contacts, 3).sum(axis=(1, 3))
    assert np.count_nonzero(blocks) / p.num_contacts**2 < 0.2


def test_friction_may_be_zero_or_infinite():
    for friction in (0, np.inf):
        assert (problems.quadruped_impact(friction=friction).friction == friction).all()


def test_options_out_of_range_are_named_with_their_range():
    for make, options, text in [
        ("box_stack", {"num_boxes": 0}, r"num_boxes is 0; it must lie in \[1, 50\]"),
        ("box_stack", {"mass_ratio": 0.5}, r"mass_ratio is 0.5; it must lie in \[1, 1e\+09\]"),
        ("box_stack", {"heavy": "middle"}, "heavy is 'middle'; choose one of 'top', 'bottom', 'alternating'"),
        ("box_stack", {"size": 0}, r"size is 0; it must lie in \[0.001, 1000\]"),
        ("box_stack", {"push": (1, 2, 3)}, r"push has shape \(3,\); it must be \(2,\)"),
        ("box_stack", {"push": (0, np.nan)}, r"push\[1\] is nan"),
        ("box_stack", {"noise": -1}, "noise is -1 m/s; it must be zero or positive"),
        ("quadruped_impact", {"friction": -0.1}, "friction is -0.1; it must be zero or positive"),
        ("quadruped_impact", {"friction": np.nan}, "friction is nan"),
        ("quadruped_impact", {"seed": -1}, "seed is -1"),
        ("duplicated_contacts", {"copies": 17}, r"copies is 17; it must lie in \[2, 16\]"),
        ("duplicated_contacts", {"base": "brick_wall"}, "base is 'brick_wall'; choose one of 'quadruped_standing'"),
        ("ill_conditioned", {"condition": 1e13}, r"condition is 1e\+13; it must lie in \[1, 1e\+12\]"),
        ("ill_conditioned", {"num_contacts": 2, "rank": 7}, r"rank is 7; it must lie in \[1, 6\]"),
        ("sphere_pile", {"layers": 8}, r"layers is 8; it must lie in \[1, 7\]"),
        ("sphere_pile", {"irregularity": 0.3}, r"irregularity is 0.3; it must lie in \[0, 0.2\]"),
        ("brick_wall", {"rows": 20, "columns": 20}, r"rows is 20 and columns is 20: 3120 contacts.* at most 1000"),
    ]:
        with pytest.raises(ValueError, match=text):
            problems.FAMILIES[make](**options)
    for make, options, text in [
        ("box_stack", {"num_boxes": 2.5}, "num_boxes is 2.5; an integer is wanted"),
        ("box_stack", {"heavy": 1}, "heavy is 1; a string is wanted"),
        ("quadruped_standing", {"friction": [0.5, 0.5]}, "friction is .*; a number is wanted"),
    ]:
        with pytest.raises(TypeError, match=text):
            problems.FAMILIES[make](**options)


def test_generate_names_unknown_families_and_options_at_once():
    with pytest.raises(ValueError, match="family is 'towers'; choose one of 'quadruped_standing', .*'brick_wall'"):
        problems.generate("towers", 3)
    with pytest.raises(TypeError, match="layers is no option of box_stack; its options are num_boxes, mass_ratio"):
        problems.generate("box_stack", 3, layers=2)
    with pytest.raises(ValueError, match="count is -1"):
        problems.generate("box_stack", -1)
    assert list(problems.generate("box_stack", 0)) == []
