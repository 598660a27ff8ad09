"""What FCLIB files hold, with FCLIB's letters, in our order (x, y, z per contact; x, z where spacedim is 2).

    local    u = W r + V l + q,    V' r + R l + s = 0
    global   M v = H r + G l + f,  G' v + b = 0,  u = H' v + w

with contact impulses r [N s], contact velocities u [m/s], generalized velocities v [m/s, rad/s] and multipliers l of equality
constraints. FCLIB itself names no units; problems of forces and accelerations keep theirs.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from stickslip._arguments import array
from stickslip._planar import spatial_to_planar
from stickslip.contact import ContactProblem, ContactSolution
from stickslip.fclib.elimination import schur, symmetric

Array = NDArray[np.float64]

_SPARSE_ROWS = 300  # smaller problems are faster dense
_SPARSE_DENSITY = 0.5


@dataclass(frozen=True, eq=False)
class Solution:
    """A solution or a guess, by FCLIB's letters."""

    u: Array  #: contact velocities [m/s], as long as q or w
    r: Array  #: contact impulses [N s]
    v: Array | None = None  #: generalized velocities of a global problem
    l: Array | None = None  # noqa: E741  #: multipliers, where there are equality constraints

    @classmethod
    def from_contact_solution(cls, solution: ContactSolution) -> Solution:
        """Impulse and velocity of what `stickslip.solve` returns."""
        return cls(u=solution.velocity, r=solution.impulse)


@dataclass(frozen=True, eq=False)
class LocalProblem:
    """`fclib_local`. Matrices may be given dense or sparse and are kept as csr_array. ValueError names the field."""

    W: sp.csr_array  #: (m, m) [1/kg], symmetric positive semidefinite; m = spacedim * contacts
    q: Array  #: (m,) [m/s]
    mu: Array  #: (contacts,)
    spacedim: int = 3  #: 3, or 2 in the plane
    V: sp.csr_array | None = None  #: (m, p), of equality constraints
    R: sp.csr_array | None = None  #: (p, p)
    s: Array | None = None  #: (p,)
    title: str = ""
    description: str = ""
    math_info: str = ""
    solution: Solution | None = None
    guesses: Sequence[Solution] = ()
    source: str = ""  #: the file it was read from; errors begin with it

    def __post_init__(self) -> None:
        m = _check_contacts(self, "q")
        _keep(self, "W", _matrix("W", self.W, (m, m)))
        given = [name for name in ("V", "R", "s") if getattr(self, name) is not None]
        if 0 < len(given) < 3:
            raise ValueError(f"{', '.join(given)} without the others; equality constraints are V, R and s together")
        if given:
            _keep(self, "s", _vector("s", self.s))
            p = len(self.s)
            _keep(self, "V", _matrix("V", self.V, (m, p)))
            _keep(self, "R", _matrix("R", self.R, (p, p)))
        _check_solutions(self, {"u": m, "r": m, "l": len(self.s) if given else 0})

    @classmethod
    def from_contact_problem(cls, problem: ContactProblem, *, spacedim: int = 3, **fields: Any) -> LocalProblem:
        """Of a `ContactProblem`; spacedim=2 for one in the plane x, z (ValueError if it is not). `fields`: texts, solutions."""
        if spacedim not in (2, 3):
            raise ValueError(f"spacedim is {spacedim}; it must be 2 or 3")
        W, q = problem.delassus, problem.free_velocity
        if spacedim == 2:
            W, q = spatial_to_planar(W, q)
        return cls(W, q, problem.friction, spacedim, **fields)

    @property
    def num_contacts(self) -> int:
        """As many as mu has."""
        return len(self.mu)

    def to_contact_problem(self) -> ContactProblem:
        """The problem without equality constraints: W - V R^-1 V', q - V R^-1 s; one in the plane gets zeros along y.

        A UserWarning says by how much W was not symmetric, if that is more than rounding. ValueError: W or R is not symmetric,
        R (which must be positive definite to be eliminated) or W is not definite.
        """
        try:
            W, says = symmetric(self.W, "W")
            q = self.q
            if self.V is not None:
                W, q, more = _without_constraints(self, W)
                says = says or more
            problem = _contact_problem(W, q, self.mu, self.spacedim)
        except ValueError as error:
            raise ValueError(_prefix(self) + str(error)) from None
        _warn(self, says)
        return problem


@dataclass(frozen=True, eq=False)
class GlobalProblem:
    """`fclib_global`. Matrices may be given dense or sparse and are kept as csr_array. ValueError names the field."""

    M: sp.csr_array  #: (nv, nv) mass matrix, symmetric positive definite
    H: sp.csr_array  #: (nv, m), transposed contact Jacobian
    f: Array  #: (nv,) generalized momentum without contacts
    w: Array  #: (m,) [m/s], what contact velocities have beyond H' v
    mu: Array  #: (contacts,)
    spacedim: int = 3  #: 3, or 2 in the plane
    G: sp.csr_array | None = None  #: (nv, p), of equality constraints
    b: Array | None = None  #: (p,)
    title: str = ""
    description: str = ""
    math_info: str = ""
    solution: Solution | None = None
    guesses: Sequence[Solution] = ()
    source: str = ""  #: the file it was read from; errors begin with it

    def __post_init__(self) -> None:
        m = _check_contacts(self, "w")
        _keep(self, "f", _vector("f", self.f))
        nv = len(self.f)
        _keep(self, "M", _matrix("M", self.M, (nv, nv)))
        _keep(self, "H", _matrix("H", self.H, (nv, m)))
        if (self.G is None) != (self.b is None):
            raise ValueError("G and b are given together or not at all: equality constraints are both")
        if self.G is not None:
            _keep(self, "b", _vector("b", self.b))
            _keep(self, "G", _matrix("G", self.G, (nv, len(self.b))))
        _check_solutions(self, {"u": m, "r": m, "v": nv, "l": 0 if self.b is None else len(self.b)})

    @property
    def num_contacts(self) -> int:
        """As many as mu has."""
        return len(self.mu)

    def to_local(self) -> LocalProblem:
        """W = H' M^-1 H, q = H' M^-1 f + w, and with constraints V = H' M^-1 G, R = G' M^-1 G, s = G' M^-1 f + b.

        ValueError: M is not symmetric, singular or indefinite.
        """
        try:
            M, says = symmetric(self.M, "M")
            m = len(self.w)
            both = self.H if self.G is None else sp.csr_array(sp.hstack([self.H, self.G], format="csr"))
            A, a = schur(M, both, self.f, "M")
            fields: dict[str, Any] = {}
            if self.G is not None:
                fields = {"V": A[:m, m:], "R": A[m:, m:], "s": a[m:] + self.b}
            texts = {name: getattr(self, name) for name in ("title", "description", "math_info", "source")}
            local = LocalProblem(A[:m, :m], a[:m] + self.w, self.mu, self.spacedim, **fields, **texts)
        except ValueError as error:
            raise ValueError(_prefix(self) + str(error)) from None
        _warn(self, says)
        return local

    def to_contact_problem(self) -> ContactProblem:
        """`to_local`, then as there; ValueError and UserWarning name M instead of W."""
        return self.to_local().to_contact_problem()


def _prefix(problem: LocalProblem | GlobalProblem) -> str:
    if not problem.source:
        return ""
    return f"{problem.source}: {'fclib_local' if isinstance(problem, LocalProblem) else 'fclib_global'}: "


def _warn(problem: LocalProblem | GlobalProblem, says: str) -> None:
    if says:
        warnings.warn(f"{_prefix(problem)}{says}; its symmetric part is used", UserWarning, stacklevel=3)


def _without_constraints(problem: LocalProblem, W: sp.csr_array) -> tuple[sp.csr_array, Array, str]:
    """W - V R^-1 V', q - V R^-1 s, and what `symmetric` says of R."""
    R, says = symmetric(problem.R, "R")
    try:
        less, shift = schur(R, sp.csr_array(problem.V.T), problem.s, "R")
    except ValueError as error:
        raise ValueError(
            f"{error}: redundant or contradictory equality constraints (V, R, s; G, b) cannot be eliminated"
        ) from None
    W = sp.csr_array(W - less)
    W.eliminate_zeros()
    return W, problem.q - shift, says


def _contact_problem(W: sp.csr_array, q: Array, mu: Array, spacedim: int) -> ContactProblem:
    """With W in the form that is solved faster."""
    rows = 3 * len(mu)
    keep_sparse = rows > _SPARSE_ROWS and W.nnz < _SPARSE_DENSITY * rows**2
    make = ContactProblem.planar if spacedim == 2 else ContactProblem
    return make(W if keep_sparse else W.toarray(), q, mu)


# Checks


def _keep(problem: Any, name: str, value: Any) -> None:
    object.__setattr__(problem, name, value)


def _vector(name: str, value: ArrayLike) -> Array:
    if np.ndim(value) != 1:
        raise ValueError(f"{name} has shape {np.shape(value)}; it must have one dimension")
    return array(name, value, np.shape(value))


def _matrix(name: str, value: Any, shape: tuple[int, int]) -> sp.csr_array:
    if np.shape(value) != shape:
        raise ValueError(f"{name} has shape {np.shape(value)}; it must be {shape}")
    try:
        result = sp.csr_array(value, dtype=np.float64, copy=True)
    except (TypeError, ValueError) as error:
        raise type(error)(f"{name}: not a matrix of numbers ({error})") from None
    result.sum_duplicates()
    result.eliminate_zeros()
    bad = np.flatnonzero(~np.isfinite(result.data))
    if len(bad):
        entries = result.tocoo()
        k = bad[0]
        raise ValueError(f"{name}[{entries.row[k]}, {entries.col[k]}] is {entries.data[k]}; it must be finite")
    return result


def _check_contacts(problem: Any, velocity: str) -> int:
    """Rows of the contacts; checks spacedim, mu and the length of q or w."""
    if problem.spacedim not in (2, 3):
        raise ValueError(f"spacedim is {problem.spacedim}; it must be 2 or 3")
    _keep(problem, velocity, _vector(velocity, getattr(problem, velocity)))
    if np.ndim(problem.mu) != 1:
        raise ValueError(f"mu has shape {np.shape(problem.mu)}; it must be (contacts,)")
    mu = np.array(problem.mu, dtype=np.float64)
    bad = np.flatnonzero(~(mu >= 0))
    if len(bad):
        raise ValueError(f"mu[{bad[0]}] is {mu[bad[0]]}; it must be zero or positive")
    _keep(problem, "mu", mu)
    m = problem.spacedim * len(mu)
    if len(getattr(problem, velocity)) != m:
        raise ValueError(
            f"{velocity} has {len(getattr(problem, velocity))} entries; {m} are expected, spacedim = {problem.spacedim} for each "
            f"of {len(mu)} contacts (as many as mu has)"
        )
    return m


def _check_solutions(problem: Any, sizes: dict[str, int]) -> None:
    """Checks the lengths in the solution and the guesses; takes iterables of guesses."""
    _keep(problem, "guesses", tuple(problem.guesses))
    named = [("solution", problem.solution)] if problem.solution is not None else []
    named += [(f"guesses[{k}]", guess) for k, guess in enumerate(problem.guesses)]
    for name, solution in named:
        if not isinstance(solution, Solution):
            raise TypeError(f"{name} is a {type(solution).__name__}; a fclib.Solution is wanted")
        for letter in ("u", "r", "v", "l"):
            size, value = sizes.get(letter, 0), getattr(solution, letter)
            if size == 0 and value is not None and letter in ("v", "l") and len(value):
                raise ValueError(f"{name}.{letter} is given, but the problem has no such unknowns")
            if size and value is None:
                raise ValueError(f"{name}.{letter} is missing; {size} numbers are expected")
            if value is not None:
                array(f"{name}.{letter}", value, (size,))
