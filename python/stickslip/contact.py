"""Frictional contact problems and their solvers, without robots.

For n contacts, find impulses `lambda` [N s] so that the velocities `v = G lambda + c` [m/s] obey Signorini's condition and
Coulomb's law at each contact. Per contact the order is x, y (tangential), z (normal).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip import _core
from stickslip._arguments import array, count, number
from stickslip._planar import planar_to_spatial

if TYPE_CHECKING:
    from scipy import sparse

Law = Literal["coulomb", "max_dissipation"]
SingleContactMethod = Literal["halley", "bisection", "golden_section", "quartic"]
SolveMethod = Literal["auto", "per_contact", "pgs", "prox_newton", "interior_point", "admm"]
Stage = Literal["start", "sweeps", "newton", "prox_newton", "interior_point", "admm"]
Array = NDArray[np.float64]

#: The methods of `solve`.
SOLVE_METHODS: tuple[SolveMethod, ...] = get_args(SolveMethod)


class ContactProblem:
    """A contact problem, dense or block sparse; per contact the order is x, y (tangential), z (normal) everywhere.

    delassus: (3n, 3n) [1/kg], J M^-1 J^T, symmetric positive semidefinite: an array, or any SciPy sparse matrix, which is kept
        in blocks of 3 x 3.
    free_velocity: (3n,) [m/s], velocity of the contact points without contact impulses.
    friction: (n,) or one number for all, zero or positive; infinite and huge values count as 1e4.

    A problem in the plane has rows (x, z) only: see `planar`. Raises ValueError that names the argument and its first offending
    entry.
    """

    def __init__(self, delassus: ArrayLike | sparse.sparray, free_velocity: ArrayLike, friction: ArrayLike):
        mu = _numbers("friction", friction)
        if mu.ndim == 0:
            mu = np.full(np.size(free_velocity) // 3, mu)
        if mu.ndim != 1:
            raise ValueError(f"friction has shape {mu.shape}; it must be (n,)")
        n = len(mu)
        self._free_velocity = _shaped("free_velocity", free_velocity, (3 * n,), n)
        self._friction = mu
        self._dimension = 3
        if hasattr(delassus, "tobsr"):
            self._delassus = _blocks(delassus, n)
            values, starts, columns = self._delassus.data, self._delassus.indptr, self._delassus.indices
        else:
            self._delassus = values = _shaped("delassus", delassus, (3 * n, 3 * n), n)
            starts = columns = np.empty(0, dtype=np.int32)
        for a in (values, starts, columns, self._free_velocity, self._friction):
            a.flags.writeable = False  # a problem that changed after its checks would not be checked
        self._core = _core.CheckedProblem(
            values.reshape(-1), self._free_velocity, mu, [int(k) for k in starts], [int(k) for k in columns]
        )

    @classmethod
    def planar(
        cls, delassus: ArrayLike | sparse.sparray, free_velocity: ArrayLike, friction: ArrayLike
    ) -> ContactProblem:
        """A problem in the x-z plane, delassus (2n, 2n) [1/kg], free_velocity (2n,) [m/s], friction (n,); order x, z per contact.

        It is kept as a problem in space whose y rows are zero: impulses and velocities are (3n,) with y = 0.
        """
        try:
            problem = cls(*planar_to_spatial(delassus, free_velocity, friction))
        except ValueError as error:
            raise type(error)(_planar_places(str(error))) from None
        problem._dimension = 2
        return problem

    @classmethod
    def load(cls, path: str | PathLike[str]) -> ContactProblem:
        """The problem of an FCLIB file (HDF5), local or global; see `stickslip.fclib.load`."""
        from stickslip import fclib

        return fclib.load(path)

    def save(self, path: str | PathLike[str], **options: Any) -> None:
        """Writes the problem as an FCLIB file; options as those of `stickslip.fclib.save`."""
        from stickslip import fclib

        fclib.save(path, self, **options)

    @property
    def delassus(self) -> Array | sparse.bsr_array:
        """(3n, 3n) [1/kg], read-only: an array, or a `scipy.sparse.bsr_array` with 3 x 3 blocks where it was given sparse."""
        if not self.is_sparse:
            return self._delassus
        # A matrix of its own on the same read-only memory: what is set on it does not reach the problem.
        kept = self._delassus
        return type(kept)((kept.data, kept.indices, kept.indptr), shape=kept.shape, copy=False)

    @property
    def is_sparse(self) -> bool:
        """`delassus` is block sparse."""
        return not isinstance(self._delassus, np.ndarray)

    def dense_delassus(self) -> Array:
        """(3n, 3n) [1/kg] as an array, whichever form is kept."""
        return self._delassus.toarray() if self.is_sparse else self._delassus

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

    @property
    def dimension(self) -> int:
        """3, or 2 for a problem made by `planar`."""
        return self._dimension

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (self._delassus, self._free_velocity, self._friction, self._dimension)

    def __repr__(self) -> str:
        form = "planar, " if self.dimension == 2 else "block sparse, " if self.is_sparse else ""
        return f"ContactProblem({form}{self.num_contacts} contacts)"


@dataclass(frozen=True, eq=False)
class Certificate:
    """How good an impulse is, from the problem and the impulse alone. Velocities are v = G impulse + c.

    residuals: (n,) residual of each contact [m/s], see `residual`; residual: the largest.
    backward_errors: (n,) the least change of the contact's velocity that makes its impulse exact under Coulomb's law [m/s];
        backward_error: the largest. "This impulse is the exact answer to a problem whose velocities differ by this."
    penetration_speed: the largest approach speed -v_z that is left, or 0 [m/s].
    cone_violation: the largest |impulse_T| - mu impulse_z, or 0 [N s].
    direction_error: the largest angle between the friction of a sliding contact and the direction against its sliding [rad].
    power: the largest |impulse . (v + mu |v_T| z)|, the energy that contact and friction add or take against the law [J].
    """

    residuals: Array  #: (n,) residual of each contact [m/s], see `residual`
    backward_errors: (
        Array  #: (n,) least change of a contact's velocity that makes its impulse exact, Coulomb's law [m/s]
    )
    residual: float  #: the largest [m/s]
    backward_error: float  #: the largest [m/s]
    penetration_speed: float  #: the largest -v_z, or 0 [m/s]
    cone_violation: float  #: the largest |impulse_T| - mu impulse_z, or 0 [N s]
    direction_error: (
        float  #: largest angle between a sliding contact's friction and the direction against its sliding [rad]
    )
    power: float  #: the largest |impulse . (v + mu |v_T| z)|, zero at a solution [J]


@dataclass(frozen=True, eq=False)
class History:
    """How a solve came about: one entry per start, sweep, step or iteration (of islands solved apart, one each).

    stage: (k) what was at work; residual: (k,) of the impulse at that point [m/s], which need not fall from entry to entry
    (`np.minimum.accumulate(history.residual)` is the best so far); time: (k,) since the solve began [s]. Empty unless asked for.
    """

    stage: list[Stage]  #: (k)
    residual: Array  #: (k,) of the impulse at that point, projected on its cones [m/s]
    time: Array  #: (k,) since the solve began [s]; recording itself takes a part of it

    def __len__(self) -> int:
        return len(self.stage)


@dataclass(frozen=True, eq=False, repr=False)
class ContactSolution:
    """What `solve` returns: the best impulse found, and how good it is.

    impulse: (3n,) [N s]; velocity: (3n,), G impulse + c [m/s]; certificate: how good it is; stage: what found it ("start" if
        nothing better was found); sweeps, newton_steps, interior_point_steps, admm_iterations: what it took.
    status: what ended the solve; whatever it is, the impulse is finite and inside its cones, and the certificate true.
        "converged": the residual is within the tolerance.
        "iteration_limit": a method chosen by name used up its sweeps or iterations. Raise the limit, or use "auto".
        "stalled": the method, or every stage of "auto", saw no way on: the tolerance lies below the rounding of the problem, or
            friction jams and no finite impulse exists, or the problem is too hard. Use "auto"; compare the residual with
            1e-16 |G_ii| |impulse_i|.
        "infeasible": a contact that cannot push (G_zz near 0) is driven in; no impulse helps. Drop it, or let its body move.
    """

    impulse: Array  #: (3n,) [N s]
    velocity: Array  #: (3n,) G impulse + c [m/s]
    certificate: Certificate
    stage: Stage  #: what found the impulse
    sweeps: int  #: passes over all contacts
    newton_steps: int  #: of the Newton finish and of proximal Newton
    interior_point_steps: int
    admm_iterations: int
    status: Literal["converged", "iteration_limit", "stalled", "infeasible"]
    history: History

    @property
    def converged(self) -> bool:
        """The residual is within the tolerance."""
        return self.status == "converged"

    @property
    def residual(self) -> float:
        """Largest contact residual [m/s]."""
        return self.certificate.residual

    @property
    def contact_residuals(self) -> Array:
        """(n,) [m/s]."""
        return self.certificate.residuals

    def __repr__(self) -> str:
        contacts = f"{len(self.contact_residuals)} contacts"
        return f"ContactSolution({self.status}, {contacts}, stage {self.stage}, residual {self.residual:.3g} m/s)"

    @property
    def iterations(self) -> int:
        """Sweeps, steps and iterations of all stages, added."""
        return self.sweeps + self.newton_steps + self.interior_point_steps + self.admm_iterations


def solve(
    problem: ContactProblem,
    method: SolveMethod = "auto",
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
    *,
    relative_tolerance: float = 0.0,
    max_iterations: int | None = None,
    minimum_norm: bool = False,
    proximal_weight: float = 1e-3,
    shift: Literal["exact", "lagged", "damped"] = "exact",
) -> ContactSolution:
    """Solves a contact problem. Never raises for a hard problem: look at `converged`, `status` and `certificate`.

    method: "auto" (the chain: sweeps with a Newton finish, proximal Newton, interior point, ADMM), or one alone: "per_contact"
        ([Hwangbo 2018] Algorithm 2), "pgs" (eq. 17, 18), "prox_newton", "interior_point", "admm".
    law: "coulomb" (eq. 6: friction opposes sliding) or "max_dissipation" (eq. 8; "auto" and "per_contact" only).
    tolerance: on the largest contact residual [m/s], or on what `stop` names.
    relative_tolerance: added to it, this much of the largest |free_velocity|.
    max_sweeps: passes over all contacts; "auto": of each of its sweep stages.
    max_iterations: steps of "prox_newton" (None: 500), "interior_point" (100) or "admm" (5000).
    impulse: (3n,) start [N s]; "interior_point" starts from a point of its own.
    minimum_norm: redundant contacts leave a choice of impulses with the same velocity, which otherwise depends on the order of
        the contacts: spread them over the contacts at rest by least norm, then, with the normal impulses held, take the
        least tangential ones.
    proximal_weight: of the first subproblem of "prox_newton", relative to G_ii.
    shift: how the steps of "interior_point" treat De Saxce's shift mu |v_T|: linearized ("exact"), from the last iterate, or
        half way towards it. Alone it ends near 1e-7 where contacts slide: "auto" goes on from there with Newton steps.
    single_contact: method of "per_contact" for one contact; "golden_section" knows "max_dissipation" only.
    alpha, alpha_min, gamma: relaxation of "per_contact", alpha <- alpha_min + gamma (alpha - alpha_min) per sweep (the paper:
        1, 0.7, 0.99); for "pgs" alpha is the constant factor of eq. 18. Default: 1, and 0.6 for "pgs".
    stop: what ends the sweeps of "per_contact" and "pgs". The paper's are "violation_sum" and "update_sum".
    single_contact_tolerance: [N s]; 0: a tenth of what `tolerance` asks for.
    history: record residual and time of every sweep, step and iteration.

    ValueError names the argument that is not usable.
    """
    p = _problem(problem)
    start = np.empty(0) if impulse is None else array("impulse", impulse, (3 * p.num_contacts,))
    if alpha is None:
        alpha = 0.6 if method == "pgs" else 1.0
    options = {
        "method": str(method),
        "law": str(law),
        "tolerance": number("tolerance", tolerance),
        "relative_tolerance": number("relative_tolerance", relative_tolerance),
        "max_sweeps": count("max_sweeps", max_sweeps),
        "max_iterations": 0 if max_iterations is None else count("max_iterations", max_iterations, least=1),
        "minimum_norm": bool(minimum_norm),
        "proximal_weight": number("proximal_weight", proximal_weight),
        "shift": str(shift),
        "single_contact": str(single_contact),
        "single_contact_tolerance": number("single_contact_tolerance", single_contact_tolerance),
        "alpha": number("alpha", alpha),
        "alpha_min": number("alpha_min", alpha_min),
        "gamma": number("gamma", gamma),
        "stop": str(stop),
        "history": bool(history),
    }
    result = p._core.solve(start, options)
    certificate, record = Certificate(**result.pop("certificate")), History(**result.pop("history"))
    return ContactSolution(**result, certificate=certificate, history=record)


def certify(problem: ContactProblem, impulse: ArrayLike, law: Law = "coulomb") -> Certificate:
    """The certificate of any impulse (3n,) [N s]: residuals, backward errors and what else may be wrong. A pure function."""
    p = _problem(problem)
    return Certificate(**p._core.certify(array("impulse", impulse, (3 * p.num_contacts,)), str(law)))


def residual(problem: ContactProblem, impulse: ArrayLike, law: Law = "coulomb") -> Array:
    """(n,) [m/s]: how far each contact is from its law, for an impulse (3n,) [N s]. A pure function; `solve` and `World` certify with it.

    "coulomb": De Saxce's natural map. "max_dissipation": |G_ii (lambda_i - exact_i)| with the others held.
    """
    return certify(problem, impulse, law).residuals


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
        cure = "no finite impulse does: it jams" if method == "halley" else "use method='halley'"
        raise ArithmeticError(f"{method} did not solve this contact to {tolerance}; {cure}")
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


def _blocks(matrix: sparse.sparray, n: int) -> sparse.bsr_array:
    """The matrix in 3 x 3 blocks, sorted, without duplicates, with every diagonal block."""
    from scipy import sparse

    if matrix.shape != (3 * n, 3 * n):
        raise ValueError(
            f"delassus has shape {matrix.shape}; it must be {(3 * n, 3 * n)} for {n} contacts (as many as friction has)"
        )
    _check_kind("delassus", matrix.dtype)
    try:
        coo = sparse.coo_array(matrix, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise type(error)(f"delassus: not a matrix of numbers ({error})") from None
    # Zeros on the diagonal are stored, so that every contact has its own block.
    diagonal = np.arange(3 * n)
    rows, columns = np.concatenate([coo.row, diagonal]), np.concatenate([coo.col, diagonal])
    values = np.concatenate([coo.data, np.zeros(3 * n)])
    blocks = sparse.coo_array((values, (rows, columns)), shape=matrix.shape).tocsr().tobsr((3, 3))
    blocks.sum_duplicates()
    blocks.sort_indices()
    return blocks


def _planar_places(text: str) -> str:
    """An error text about a problem in space with its rows counted in the plane: 3 k becomes 2 k, 3 k + 2 becomes 2 k + 1."""

    def place(match: re.Match[str]) -> str:
        row, column = (2 * (int(k) // 3) + (int(k) % 3 > 0) for k in match.groups())
        return f"[{row}, {column}]"

    text = re.sub(r"\[(\d+), (\d+)\](?! \()", place, text)
    return re.sub(r"columns 0 to (\d+)", lambda m: f"columns 0 to {2 * (int(m[1]) // 3) + (int(m[1]) % 3 > 0)}", text)


def _unpickled(delassus: Any, free_velocity: Array, friction: Array, dimension: int) -> ContactProblem:
    problem = ContactProblem(delassus, free_velocity, friction)
    problem._dimension = dimension
    return problem


def _problem(value: ContactProblem) -> ContactProblem:
    if not isinstance(value, ContactProblem):
        raise TypeError(f"problem is a {type(value).__name__}; a ContactProblem is wanted")
    return value


def _numbers(name: str, value: ArrayLike) -> Array:
    """A contiguous copy as float64; NaN is left to the checks that name it."""
    try:
        _check_kind(name, np.asarray(value).dtype)
        return np.array(value, dtype=np.float64, order="C", copy=True)
    except (TypeError, ValueError) as error:
        raise type(error)(f"{name}: not an array of numbers ({error})") from None


def _check_kind(name: str, dtype: np.dtype[Any]) -> None:
    """Numbers that are real: complex ones would lose their imaginary part, texts would be parsed."""
    if dtype.kind not in "biufO":
        raise ValueError(f"{name} holds {dtype}; it must hold real numbers")


def _shaped(name: str, value: ArrayLike, shape: tuple[int, ...], contacts: int | None = None) -> Array:
    result = _numbers(name, value)
    if result.shape != shape:
        reason = "" if contacts is None else f" for {contacts} contacts (as many as friction has)"
        if contacts and result.shape == tuple(2 * k // 3 for k in shape):
            reason += "; problems in the plane are made by ContactProblem.planar"
        raise ValueError(f"{name} has shape {result.shape}; it must be {shape}{reason}")
    return result
