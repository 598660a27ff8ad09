"""Frictional contact problems and their solvers, without robots.

For n contacts, find impulses `lambda` [N s] so that the velocities `v = G lambda + c` [m/s] obey Signorini's condition and
Coulomb's law at each contact. Per contact the order is x, y (tangential), z (normal).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip import _core
from stickslip._arguments import array, count, number

Law = Literal["coulomb", "max_dissipation"]
SingleContactMethod = Literal["halley", "bisection", "golden_section", "quartic"]
Array = NDArray[np.float64]


class ContactProblem:
    """A dense contact problem.

    delassus: (3n, 3n) [1/kg], J M^-1 J^T, symmetric positive semidefinite.
    free_velocity: (3n,) [m/s], velocity of the contact points without contact impulses.
    friction: (n,), zero or positive; infinite and huge values count as 1e4.

    Raises ValueError that names the argument and its first offending entry.
    """

    def __init__(self, delassus: ArrayLike, free_velocity: ArrayLike, friction: ArrayLike):
        mu = _numbers("friction", friction)
        if mu.ndim != 1:
            raise ValueError(f"friction has shape {mu.shape}; it must be (n,)")
        n = len(mu)
        self._delassus = _shaped("delassus", delassus, (3 * n, 3 * n), n)
        self._free_velocity = _shaped("free_velocity", free_velocity, (3 * n,), n)
        self._friction = mu
        for a in (self._delassus, self._free_velocity, self._friction):
            a.flags.writeable = False  # a problem that changed after its checks would not be checked
        _core.validate_contact_problem(*self._arrays())

    @property
    def delassus(self) -> Array:
        """(3n, 3n) [1/kg], read-only."""
        return self._delassus

    @property
    def free_velocity(self) -> Array:
        """(3n,) [m/s], read-only."""
        return self._free_velocity

    @property
    def friction(self) -> Array:
        """(n,), read-only."""
        return self._friction

    @property
    def num_contacts(self) -> int:
        """n, as many as `friction` has."""
        return len(self._friction)

    def _arrays(self) -> tuple[Array, Array, Array]:
        return self._delassus.reshape(-1), self._free_velocity, self._friction

    def __repr__(self) -> str:
        return f"ContactProblem({self.num_contacts} contacts)"


@dataclass(frozen=True)
class ContactSolution:
    """What `solve` returns: the best impulse found, and how good it is."""

    impulse: Array  #: (3n,) [N s]
    velocity: Array  #: (3n,) G impulse + c [m/s]
    residual: float  #: largest contact residual [m/s]
    contact_residuals: Array  #: (n,) [m/s]
    sweeps: int  #: passes over all contacts
    newton_steps: int  #: of the finish and the fallback of method "auto"
    status: Literal["converged", "not_converged", "infeasible"]  #: infeasible: a contact that cannot push is driven in
    history: Array  #: value of the stop test after each sweep (method "auto": residual after each stage), if asked for

    @property
    def converged(self) -> bool:
        """The residual is at most the tolerance."""
        return self.status == "converged"


def solve(
    problem: ContactProblem,
    method: Literal["auto", "per_contact", "pgs"] = "auto",
    law: Law = "coulomb",
    tolerance: float = 1e-9,
    max_sweeps: int = 1000,
    impulse: ArrayLike | None = None,
    single_contact: SingleContactMethod = "halley",
    alpha: float | None = None,
    alpha_min: float = 0.7,
    gamma: float = 1.0,
    stop: Literal["residual", "violation_sum", "update_sum"] = "residual",
    single_contact_tolerance: float = 0.0,
    history: bool = False,
) -> ContactSolution:
    """Solves a contact problem. Never raises for a hard problem: look at `converged` and `residual`.

    method: "auto" (sweeps, Newton finish, fallback), "per_contact" ([Hwangbo 2018] Algorithm 2), "pgs" (eq. 17, 18).
    law: "coulomb" (eq. 6: friction opposes sliding) or "max_dissipation" (eq. 8; not with "pgs").
    tolerance: on the largest contact residual [m/s], or on what `stop` names.
    max_sweeps: passes over all contacts; "auto": of each of its stages.
    impulse: (3n,) start [N s].
    single_contact: method of "per_contact" for one contact; "golden_section" knows "max_dissipation" only.
    alpha, alpha_min, gamma: relaxation of "per_contact", alpha <- alpha_min + gamma (alpha - alpha_min) per sweep (the paper:
        1, 0.7, 0.99); for "pgs" alpha is the constant factor of eq. 18. Default: 1, and 0.6 for "pgs".
    stop: what ends the sweeps of "per_contact" and "pgs". The paper's are "violation_sum" and "update_sum".
    single_contact_tolerance: [N s]; 0: a tenth of what `tolerance` asks for.
    history: record the stop test after each sweep.

    ValueError names the argument that is not usable.
    """
    p = _problem(problem)
    start = np.empty(0) if impulse is None else array("impulse", impulse, (3 * p.num_contacts,))
    if alpha is None:
        alpha = 0.6 if method == "pgs" else 1.0
    core = _core.solve_contact_problem(
        *p._arrays(),
        start,
        str(method),
        str(law),
        number("tolerance", tolerance),
        count("max_sweeps", max_sweeps),
        str(single_contact),
        number("single_contact_tolerance", single_contact_tolerance),
        number("alpha", alpha),
        number("alpha_min", alpha_min),
        number("gamma", gamma),
        str(stop),
        bool(history),
    )
    x, v, each, worst, sweeps, newton_steps, status, record = core
    return ContactSolution(x, v, worst, each, sweeps, newton_steps, status, record)


def residual(problem: ContactProblem, impulse: ArrayLike, law: Law = "coulomb") -> Array:
    """(n,) [m/s]: how far each contact is from its law, for an impulse (3n,) [N s]. A pure function; `solve` and `World` certify with it.

    "coulomb": De Saxce's natural map. "max_dissipation": |G_ii (lambda_i - exact_i)| with the others held.
    """
    p = _problem(problem)
    return _core.contact_problem_residual(*p._arrays(), array("impulse", impulse, (3 * p.num_contacts,)), str(law))


def solve_contact(
    delassus: ArrayLike,
    free_velocity: ArrayLike,
    friction: float,
    method: SingleContactMethod = "halley",
    law: Law = "coulomb",
    tolerance: float = 1e-10,
) -> Array:
    """(3,) [N s]: the impulse of a single contact, delassus (3, 3) [1/kg], free_velocity (3,) [m/s], friction >= 0.

    tolerance: "halley": residual velocity over |free_velocity|; the others: impulse interval [N s].
    Raises ArithmeticError where the method fails, which "halley" and "bisection" do not, and where no finite impulse solves the
    contact (delassus singular, a large friction: it jams).
    """
    G = _shaped("delassus", delassus, (3, 3))
    c = _shaped("free_velocity", free_velocity, (3,))
    if np.ndim(friction) != 0:
        raise ValueError(f"friction has shape {np.shape(friction)}; it must be a number")
    x, _, converged = _core.solve_single_contact(
        G.reshape(-1), c, float(friction), str(method), str(law), number("tolerance", tolerance)
    )
    if not converged:
        raise ArithmeticError(f"{method} did not solve this contact to {tolerance}; use method='halley'")
    return x


def _time_single_contact(
    delassus: ArrayLike,
    free_velocity: ArrayLike,
    friction: ArrayLike,
    methods: str | Sequence[str],
    law: Law = "max_dissipation",
    tolerance: float = 1e-6,
    rounds: int = 7,
) -> dict[str, tuple[float, float, float]]:
    """Median ns per solve, evaluations per sliding contact and share of failures of each method, timed in turns.

    delassus (k, 3, 3), free_velocity (k, 3), friction (k,); tolerance [N s]. For Table I of the report.
    """
    mu = _numbers("friction", friction)
    G = _shaped("delassus", delassus, (len(mu), 3, 3))
    c = _shaped("free_velocity", free_velocity, (len(mu), 3))
    names = [methods] if isinstance(methods, str) else list(methods)
    times = _core._time_single_contact(G.reshape(-1), c.reshape(-1), mu, names, str(law), float(tolerance), int(rounds))
    return dict(zip(names, times, strict=True))


def _problem(value: ContactProblem) -> ContactProblem:
    if not isinstance(value, ContactProblem):
        raise TypeError(f"problem is a {type(value).__name__}; a ContactProblem is wanted")
    return value


def _numbers(name: str, value: ArrayLike) -> Array:
    """A contiguous copy as float64; NaN is left to the checks that name it."""
    try:
        return np.array(value, dtype=np.float64, order="C", copy=True)
    except (TypeError, ValueError) as error:
        raise type(error)(f"{name}: not an array of numbers ({error})") from None


def _shaped(name: str, value: ArrayLike, shape: tuple[int, ...], contacts: int | None = None) -> Array:
    result = _numbers(name, value)
    if result.shape != shape:
        reason = "" if contacts is None else f" for {contacts} contacts (as many as friction has)"
        raise ValueError(f"{name} has shape {result.shape}; it must be {shape}{reason}")
    return result
