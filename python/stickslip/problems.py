"""Families of contact problems, for comparing and testing solvers.

Every problem is `delassus = J M^-1 J^T` and `free_velocity = J u_free` of rigid bodies after one step of free motion, 1 ms:
`u_free = u + dt (g + M^-1 f)`, with the velocity u before the step, gravity g and forces f. The free velocity lies in the range
of the Delassus matrix. Contacts are hard and inelastic; all contacts of a problem have the same friction.

A problem is a pure function of its seed and options, the same on every machine. An option that is None is drawn from the seed.
`generate("box_stack", 100, mass_ratio=1e4)` iterates over the problems of the seeds 0 to 99; `FAMILIES` has all families by name.

ValueError names an option that is out of range, and the range.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal

from stickslip import _core
from stickslip._arguments import array, count, number
from stickslip.contact import ContactProblem

__all__ = [
    "FAMILIES",
    "box_stack",
    "brick_wall",
    "duplicated_contacts",
    "eight_contacts_impact",
    "eight_contacts_resting",
    "generate",
    "ill_conditioned",
    "quadruped_impact",
    "quadruped_standing",
    "quadruped_trotting",
    "sphere_pile",
]


def quadruped_standing(seed: int = 0, *, friction: float | None = None) -> ContactProblem:
    """Four feet of a quadruped at rest, with random joint torques.

    The robot weighs 33 kg and has 18 degrees of freedom; its posture is random (the same for a seed in every family of
    quadrupeds), also knees that bend either way. Joint torques: normal, 15 N m; velocities before the step: normal, 1e-3 m/s
    and rad/s.
    friction: zero or positive; None: 0.3 to 1.
    """
    return _quadruped("quadruped_standing", seed, friction)


def quadruped_trotting(seed: int = 0, *, friction: float | None = None) -> ContactProblem:
    """Two, three or four feet of the quadruped while it moves at 1.5 m/s.

    Joint torques: normal, 20 N m; velocities before the step: normal, 0.3 m/s and rad/s, plus 1.5 m/s forward.
    friction: zero or positive; None: 0.3 to 1.
    """
    return _quadruped("quadruped_trotting", seed, friction)


def quadruped_impact(seed: int = 0, *, friction: float | None = None) -> ContactProblem:
    """Four feet of the quadruped that land at once.

    Velocities before the step: normal, 2 m/s and rad/s, plus 3 m/s downwards.
    friction: zero or positive; None: 0.3 to 1.
    """
    return _quadruped("quadruped_impact", seed, friction)


def eight_contacts_resting(seed: int = 0, *, friction: float | None = None) -> ContactProblem:
    """Four feet and the four lower corners of the torso of the quadruped at rest: 24 rows of rank at most 18.

    Joint torques: normal, 10 N m; velocities before the step: normal, 1e-2 m/s and rad/s.
    friction: zero or positive; None: 0.3 to 1.
    """
    return _quadruped("eight_contacts_resting", seed, friction)


def eight_contacts_impact(seed: int = 0, *, friction: float | None = None) -> ContactProblem:
    """Four feet and the four lower corners of the torso of the quadruped that land at once.

    Velocities before the step as in `quadruped_impact`.
    friction: zero or positive; None: 0.3 to 1.
    """
    return _quadruped("eight_contacts_impact", seed, friction)


def box_stack(
    seed: int = 0,
    *,
    num_boxes: int | None = None,
    mass_ratio: float = 1.0,
    heavy: Literal["top", "bottom", "alternating"] | None = None,
    size: float = 0.2,
    push: Sequence[float] | None = None,
    noise: float | None = None,
    friction: float | None = None,
) -> ContactProblem:
    """A stack of cubes on the ground, with four contacts at the corners of each face.

    Contacts go from the ground up, corners in the order (-, -), (+, -), (-, +), (+, +) of x and y: 12 rows per box, of rank 6.
    Velocities are those of the upper box minus those of the lower one.

    num_boxes: 1 to 50; None: 2 to 5.
    mass_ratio: 1 to 1e9; the heavy boxes weigh `mass_ratio` kg, the others 1 kg.
    heavy: "top" (the hard case), "bottom" or "alternating" (the second, the fourth, ...); None: one of them.
    size: edge, 1e-3 to 1e3 [m].
    push: (2,) force on the top box during the step, along x and y [N]; None: none in half of the problems, else up to 1.5 times
        what the friction of its weight holds, in any direction.
    noise: standard deviation of the boxes' velocities before the step [m/s], of their angular velocities `noise / size`
        [rad/s]; None: 0 in half of the problems, else 1e-4 to 0.1.
    friction: zero or positive; None: 0.3 to 1.
    """
    pushed = None if push is None else tuple(array("push", push, (2,)).tolist())
    return _problem(
        _core.problems.box_stack(
            count("seed", seed),
            _optional(count, "num_boxes", num_boxes),
            number("mass_ratio", mass_ratio),
            _optional(_word, "heavy", heavy),
            number("size", size),
            pushed,
            _optional(number, "noise", noise),
            _optional(_friction, "friction", friction),
        )
    )


def duplicated_contacts(
    seed: int = 0,
    *,
    base: Literal[
        "quadruped_standing",
        "quadruped_trotting",
        "quadruped_impact",
        "eight_contacts_resting",
        "eight_contacts_impact",
        "box_stack",
    ]
    | None = None,
    copies: int | None = None,
    friction: float | None = None,
) -> ContactProblem:
    """The problem with the same seed of another family, with every contact several times, side by side.

    Velocities are those of the base; impulses are not unique.

    base: family that is duplicated; None: one of those that can be.
    copies: of each contact, 2 to 16; None: 2 or 4.
    friction: zero or positive; None: that of the base.
    """
    return _problem(
        _core.problems.duplicated_contacts(
            count("seed", seed),
            _optional(_word, "base", base),
            _optional(count, "copies", copies),
            _optional(_friction, "friction", friction),
        )
    )


def ill_conditioned(
    seed: int = 0,
    *,
    num_contacts: int | None = None,
    condition: float | None = None,
    rank: int | None = None,
    friction: float | None = None,
) -> ContactProblem:
    """`delassus = Y Y^T` with random eigenvectors and a given condition number, `free_velocity = Y x` with x normal.

    The nonzero eigenvalues are 1 and 1 / condition [1/kg], the others between them with a uniform logarithm. Coordinates x are
    those in which the bodies have unit mass, so that they move with 1/2 J per degree of freedom in the mean. A motion that lifts
    all contacts at once lies in the range of Y, so that a solution exists.

    num_contacts: 1 to 100; None: 2 to 8.
    condition: largest over smallest nonzero eigenvalue, 1 to 1e12; None: any of these, its logarithm uniform.
    rank: 1 to 3 num_contacts; None: half of this to all of it.
    friction: zero or positive; None: 0.3 to 1.
    """
    return _problem(
        _core.problems.ill_conditioned(
            count("seed", seed),
            _optional(count, "num_contacts", num_contacts),
            _optional(number, "condition", condition),
            _optional(count, "rank", rank),
            _optional(_friction, "friction", friction),
        )
    )


def sphere_pile(
    seed: int = 0,
    *,
    layers: int | None = None,
    mass_ratio: float = 1.0,
    irregularity: float = 0.02,
    noise: float | None = None,
    friction: float | None = None,
) -> ContactProblem:
    """A pyramid of spheres of about 0.05 m on the ground: `layers` x `layers` below, one on top. Block-sparse.

    Each sphere rests on the four below it; neighbors in a layer touch where their irregular radii overlap. 7 layers have 140
    spheres and 413 to 637 contacts. Spheres roll: each has six degrees of freedom.

    layers: 1 to 7; None: 2 to 5.
    mass_ratio: 1 to 1e9; masses are 1 to `mass_ratio` kg, their logarithm uniform.
    irregularity: of radii and centers, over the radius, 0 to 0.2.
    noise: standard deviation of the spheres' velocities before the step [m/s], of angular velocities `noise / radius` [rad/s];
        None: 0 in half of the problems, else 1e-4 to 0.1.
    friction: zero or positive; None: 0.3 to 1.
    """
    return _problem(
        _core.problems.sphere_pile(
            count("seed", seed),
            _optional(count, "layers", layers),
            number("mass_ratio", mass_ratio),
            number("irregularity", irregularity),
            _optional(number, "noise", noise),
            _optional(_friction, "friction", friction),
        )
    )


def brick_wall(
    seed: int = 0,
    *,
    rows: int | None = None,
    columns: int | None = None,
    mass_ratio: float = 1.0,
    noise: float | None = None,
    friction: float | None = None,
) -> ContactProblem:
    """A wall of bricks of 0.24 x 0.12 x 0.08 m and 1 kg on the ground, without mortar. Block-sparse.

    Every second row is shifted by half a brick and closed by half bricks. Four contacts at the corners of each area where two
    bricks overlap: 4 columns (2 rows - 1) contacts, at most 1000.

    rows, columns: 1 to 20; None: 2 to 6.
    mass_ratio: 1 to 1e9; densities differ by up to this factor, their logarithm uniform.
    noise: standard deviation of the bricks' velocities before the step [m/s], of angular velocities `noise / 0.24 m` [rad/s];
        None: 0 in half of the problems, else 1e-4 to 0.1.
    friction: zero or positive; None: 0.3 to 1.
    """
    return _problem(
        _core.problems.brick_wall(
            count("seed", seed),
            _optional(count, "rows", rows),
            _optional(count, "columns", columns),
            number("mass_ratio", mass_ratio),
            _optional(number, "noise", noise),
            _optional(_friction, "friction", friction),
        )
    )


#: All families by name: functions of a seed and options.
FAMILIES: dict[str, Callable[..., ContactProblem]] = {
    "quadruped_standing": quadruped_standing,
    "quadruped_trotting": quadruped_trotting,
    "quadruped_impact": quadruped_impact,
    "eight_contacts_resting": eight_contacts_resting,
    "eight_contacts_impact": eight_contacts_impact,
    "box_stack": box_stack,
    "duplicated_contacts": duplicated_contacts,
    "ill_conditioned": ill_conditioned,
    "sphere_pile": sphere_pile,
    "brick_wall": brick_wall,
}


def generate(family: str, count: int, seed: int = 0, **options: Any) -> Iterator[ContactProblem]:
    """Iterates over `count` problems of a family: those of the seeds `seed`, `seed + 1`, ...

    options: of the family's function. ValueError lists the families, TypeError the options.
    """
    if family not in FAMILIES:
        raise ValueError(f"family is {family!r}; choose one of {', '.join(map(repr, FAMILIES))}")
    make = FAMILIES[family]
    known = [name for name in inspect.signature(make).parameters if name != "seed"]
    for name in options:
        if name not in known:
            raise TypeError(f"{name} is no option of {family}; its options are {', '.join(known)}")
    first, number_of_problems = _count("seed", seed), _count("count", count)
    return (make(first + i, **options) for i in range(number_of_problems))


_count = count  # `generate` has an argument of this name


def _quadruped(family: str, seed: int, friction: float | None) -> ContactProblem:
    return _problem(_core.problems.quadruped(family, count("seed", seed), _optional(_friction, "friction", friction)))


def _problem(arrays: tuple[Any, ...]) -> ContactProblem:
    delassus, free_velocity, friction, starts, columns = arrays
    if starts:
        from scipy import sparse

        size = len(free_velocity)
        delassus = sparse.bsr_array((delassus, columns, starts), shape=(size, size))
    return ContactProblem(delassus, free_velocity, friction)


def _optional(check: Callable[[str, Any], Any], name: str, value: Any) -> Any:
    return None if value is None else check(name, value)


def _word(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{name} is {value!r}; a string is wanted")
    return value


def _friction(name: str, value: Any) -> float:
    """A number; infinite friction is allowed, what is negative or NaN is named by the core."""
    try:
        return float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} is {value!r}; a number is wanted") from None
