"""Problems to write to FCLIB files in tests."""

from __future__ import annotations

import numpy as np

from stickslip import fclib


def delassus(rows: int, seed: int = 0) -> np.ndarray:
    """Positive definite, with a few zeros."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(rows, rows)) * (rng.random((rows, rows)) < 0.6)
    return A @ A.T + np.eye(rows)


def local_problem(contacts: int = 4, spacedim: int = 3, constraints: int = 0, seed: int = 0) -> fclib.LocalProblem:
    rng = np.random.default_rng(seed)
    m, p = spacedim * contacts, constraints
    A = delassus(m + p, seed)
    extra = {"V": A[:m, m:], "R": A[m:, m:], "s": rng.normal(size=p)} if p else {}
    guess = {"l": rng.normal(size=p)} if p else {}
    solutions = [fclib.Solution(u=rng.normal(size=m), r=rng.normal(size=m), **guess) for _ in range(3)]
    return fclib.LocalProblem(
        A[:m, :m],
        rng.normal(size=m),
        rng.uniform(0, 1, contacts),
        spacedim,
        **extra,
        title="Boxes",
        description="café, 5 kg",
        math_info="unknown",
        solution=solutions[0],
        guesses=solutions[1:],
    )


def global_problem(
    dofs: int = 7, contacts: int = 3, spacedim: int = 3, constraints: int = 0, seed: int = 0
) -> fclib.GlobalProblem:
    rng = np.random.default_rng(seed)
    m, p = spacedim * contacts, constraints
    H = rng.normal(size=(dofs, m)) * (rng.random((dofs, m)) < 0.5)
    extra = {"G": rng.normal(size=(dofs, p)), "b": rng.normal(size=p)} if p else {}
    guess = {"l": rng.normal(size=p)} if p else {}
    solution = fclib.Solution(u=rng.normal(size=m), r=rng.normal(size=m), v=rng.normal(size=dofs), **guess)
    return fclib.GlobalProblem(
        delassus(dofs, seed),
        H,
        rng.normal(size=dofs),
        rng.normal(size=m),
        rng.uniform(0, 1, contacts),
        spacedim,
        **extra,
        title="Boxes",
        solution=solution,
        guesses=[solution],
    )
