"""Batches: many copies of one scene in lockstep, one environment per SIMD lane, threads across packs of lanes.

The bits of an environment depend on nothing but its own inputs: not on `num_envs`, the number of threads, the instruction
set or its neighbors. In float64 they are those of a `World`.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from stickslip import _batch_inputs as inputs
from stickslip import _core
from stickslip._arguments import count, saved_state
from stickslip._batch_inputs import Columns
from stickslip._core import Model
from stickslip._profiling import Profiled
from stickslip.reports import StepStatus
from stickslip.world import World

__all__ = ["Batch", "ContactPoint"]

Array = NDArray[Any]
_PARAMETERS = ("kp", "kd", "friction", "gravity", "body_mass", "body_com", "body_inertia")
_PRECISIONS = ("float32", "float64")


@dataclass(frozen=True)
class ContactPoint:
    """A point of a robot that may touch the ground."""

    body: str  #: name of its body
    shape: str  #: name of its shape: the URDF link and the shape's index there, as in "LF_FOOT/0"
    point: int  #: of the shape; a box has 8 corners


class Batch(Profiled):
    """Copies of a world with one robot, each with state, inputs and, where asked for, parameters of its own.

    world: gives robot, gravity, ground, materials, options, gains, forces and present state; it is not touched, and may go.
    num_envs: environments, at least 1.
    dtype: "float32" (fastest) or "float64" (the bits of a World).
    num_threads: 0 for one per core (hardware thread) that the calling thread may run on, at most one per pack.
    pin_threads: bind each but the calling one to one of these cores.
    instruction_set: "avx512", "avx2" or "neon"; None for what STICKSLIP_ISA says, else the widest that the machine has.
    regroup_every: steps, at least, after which environments that touch the ground with the same points are brought together
        in packs, up to 16 times as many while little changes; 0 for never. Shows in speed only.

    ValueError says what a batch cannot hold (no robot or several, a method other than "auto", ...) and what to do.

    Arrays are views of the batch's own memory, (num_envs, ...), C-contiguous and writable, always the same object: write
    into them, or assign whole arrays (`batch.pd_target = targets`), which are copied. What is assigned broadcasts as in
    NumPy: (num_envs, k), (k,) for all environments alike, (num_envs, 1), or a number; from NumPy, lists, or anything with
    `__dlpack__` or `__array__` (PyTorch, JAX). TypeError or ValueError for another shape or another kind of number.
    `torch.from_dlpack(batch.q)` shares the memory. A view keeps the memory alive.

    A batch belongs to one thread at a time; its own threads work inside `step`.
    """

    def __init__(
        self,
        world: World,
        num_envs: int,
        dtype: DTypeLike = "float32",
        num_threads: int = 0,
        *,
        pin_threads: bool = False,
        instruction_set: str | None = None,
        regroup_every: int = 16,
    ):
        if not isinstance(world, World):
            raise TypeError(f"world is a {type(world).__name__}; a stickslip.World is wanted")
        if instruction_set is not None and not isinstance(instruction_set, str):
            raise TypeError(f"instruction_set is {instruction_set!r}; a name such as 'avx2', or None, is wanted")
        self._dtype = _precision(dtype)
        self._core = _core.Batch(
            world._core,
            num_envs=count("num_envs", num_envs, least=1),
            precision=self._dtype.name,
            num_threads=count("num_threads", num_threads),
            pin_threads=bool(pin_threads),
            instruction_set=instruction_set or "",
            regroup_every=count("regroup_every", regroup_every),
        )
        self._model: Model = self._core.model
        self._num_envs: int = self._core.num_envs
        self._views: dict[str, Array] = {}
        self._name_columns()

    def _name_columns(self) -> None:
        model = self._model
        shapes, bodies = [shape.name for shape in model.shapes], model.body_names
        self._contact_points = [
            ContactPoint(bodies[p.body], shapes[p.shape], p.point) for p in self._core.contact_points
        ]
        self._bodies = Columns("body", bodies)
        self._joints = Columns("joint", model.joint_names)
        self._shapes = Columns("shape", [shapes[index] for index in self._core.contact_shapes])
        self._moves = np.array([model.base == "floating" or body.joint >= 0 for body in model.bodies])

    def __repr__(self) -> str:
        return (
            f"<stickslip.Batch of {self.num_envs} {self.model.name!r} in {self.dtype.name}: {self.width} lanes "
            f"({self.instruction_set}), threads: {self.num_threads}>"
        )

    def __setattr__(self, name: str, value: Any) -> None:
        if not name.startswith("_"):
            self._check_settable(name)
        try:
            object.__setattr__(self, name, value)
        except (AttributeError, TypeError, ValueError) as error:
            if not isinstance(value, np.ndarray) or value is not self._views.get(name):
                raise
            raise type(error)(f"{error}; an operator such as += has put its result into the array already") from None

    def __reduce__(self) -> NoReturn:
        raise TypeError(  # for copy, deepcopy and pickle alike
            "a Batch can be neither copied nor pickled; make another one of the same world, and pass the state with "
            "save_state() and load_state()"
        )

    # What it is

    @property
    def model(self) -> Model:
        """The robot's description."""
        return self._model

    @property
    def num_envs(self) -> int:
        """Environments."""
        return self._num_envs

    @property
    def dtype(self) -> np.dtype:
        """float32 or float64: of all arrays that do not say another."""
        return self._dtype

    @property
    def num_threads(self) -> int:
        """Threads that a step uses."""
        return self._core.num_threads

    @property
    def instruction_set(self) -> str:
        """ "avx512", "avx2" or "neon"."""
        return self._core.instruction_set

    @property
    def width(self) -> int:
        """Environments per pack: the lanes of a register."""
        return self._core.width

    @property
    def time_step(self) -> float:
        """Length of a step [s]."""
        return self._core.time_step

    @property
    def memory_bytes(self) -> int:
        """Memory that the batch holds now; parameters count from their first use."""
        return self._core.memory_bytes

    @property
    def contact_points(self) -> list[ContactPoint]:
        """Columns of `contact_impulse` and `contact_active`."""
        return list(self._contact_points)

    @property
    def contact_shapes(self) -> list[str]:
        """Columns of `friction`: names of the shapes that may touch the ground."""
        return list(self._shapes.names)

    # State

    @property
    def q(self) -> Array:
        """(num_envs, nq) base position [m], base quaternion w x y z, joints [rad or m].

        May be written between steps; the next step then forgets warm-start impulses of that environment, as `reset` does.
        Assigning checks that numbers are finite and quaternions near unit length; what is written into the view is judged
        by the next step, which flags environments that are not finite.
        """
        return self._view("q")

    @q.setter
    def q(self, value: ArrayLike) -> None:
        self._assign("q", value, (self._model.nq,), self._check_q)

    @property
    def u(self) -> Array:
        """(num_envs, nu) base linear [m/s] and angular velocity [rad/s] of the base origin in world axes, joint rates.

        May be written between steps, as `q`. Environments whose numbers are not finite are flagged by the next step.
        """
        return self._view("u")

    @u.setter
    def u(self, value: ArrayLike) -> None:
        self._assign("u", value, (self._model.nu,))

    @property
    def time(self) -> NDArray[np.float64]:
        """(num_envs,) float64, since the last reset [s]."""
        return self._view("time")

    # Inputs. NaN in them is no error here: the step flags the environment.

    @property
    def generalized_force(self) -> Array:
        """(num_envs, nu) [N, N m], order and axes of `u`; acts until it is changed.

        NaN or infinity flags that environment in the next step, and no other.
        """
        return self._view("generalized_force")

    @generalized_force.setter
    def generalized_force(self, value: ArrayLike) -> None:
        self._assign("generalized_force", value, (self._model.nu,))

    @property
    def pd_target(self) -> Array:
        """(num_envs, joints) of tau = kp (pd_target - q) - kd u, taken implicitly [rad or m].

        NaN or infinity flags that environment in the next step, and no other.
        """
        return self._view("pd_target")

    @pd_target.setter
    def pd_target(self, value: ArrayLike) -> None:
        self._assign("pd_target", value, (self._model.num_joints,))

    @property
    def external_wrench(self) -> Array:
        """(num_envs, bodies, 6) force [N] and torque [N m] on each body at its center of mass, world axes.

        Acts until it is changed, beside `generalized_force`. NaN or infinity flags that environment in the next step.
        """
        return self._view("external_wrench")

    @external_wrench.setter
    def external_wrench(self, value: ArrayLike) -> None:
        self._assign("external_wrench", value, (len(self._bodies.names), 6))

    # The last step

    @property
    def contact_impulse(self) -> Array:
        """(num_envs, points, 3) on the robot, world axes, of the last substep [N s]; `contact_points` names the columns."""
        return self._view("contact_impulse")

    @property
    def contact_active(self) -> NDArray[np.bool_]:
        """(num_envs, points) bool: the point was in the solve of the last substep."""
        return self._view("contact_active")

    @property
    def status(self) -> NDArray[np.uint32]:
        """(num_envs,) uint32: `StepStatus` bits of the last `step` call, or-ed over its steps; see `flagged`."""
        return self._view("status")

    @property
    def residual(self) -> Array:
        """(num_envs,) largest contact residual of the last `step` call [m/s]."""
        return self._view("residual")

    # Parameters. All environments share them until one is read or assigned: then each has its own. Assigned values are
    # checked; what is written into a view is not, and a step flags environments that it makes overflow.

    @property
    def kp(self) -> Array:
        """(num_envs, joints) gains of the implicit PD control [N m/rad or N/m], >= 0."""
        return self._view("kp")

    @kp.setter
    def kp(self, value: ArrayLike) -> None:
        self._assign("kp", value, (self._model.num_joints,), self._check_not_negative(self._joints))

    @property
    def kd(self) -> Array:
        """(num_envs, joints) damping of the implicit PD control [N m s/rad or N s/m], >= 0."""
        return self._view("kd")

    @kd.setter
    def kd(self, value: ArrayLike) -> None:
        self._assign("kd", value, (self._model.num_joints,), self._check_not_negative(self._joints))

    @property
    def friction(self) -> Array:
        """(num_envs, contact shapes) Coulomb's coefficient with the ground [1], >= 0; `contact_shapes` names the columns."""
        return self._view("friction")

    @friction.setter
    def friction(self, value: ArrayLike) -> None:
        self._assign("friction", value, (len(self._shapes.names),), self._check_not_negative(self._shapes))

    @property
    def gravity(self) -> Array:
        """(num_envs, 3) acceleration by gravity, world axes [m/s^2]."""
        return self._view("gravity")

    @gravity.setter
    def gravity(self, value: ArrayLike) -> None:
        self._assign("gravity", value, (3,), self._check_finite(Columns("axis", "xyz")))

    @property
    def body_mass(self) -> Array:
        """(num_envs, bodies) [kg], > 0 for bodies that move."""
        return self._view("body_mass")

    @body_mass.setter
    def body_mass(self, value: ArrayLike) -> None:
        self._assign("body_mass", value, (len(self._bodies.names),), self._check_masses)

    @property
    def body_com(self) -> Array:
        """(num_envs, bodies, 3) center of mass in the body frame [m]."""
        return self._view("body_com")

    @body_com.setter
    def body_com(self, value: ArrayLike) -> None:
        self._assign("body_com", value, (len(self._bodies.names), 3), self._check_finite(self._bodies))

    @property
    def body_inertia(self) -> Array:
        """(num_envs, bodies, 6) xx xy xz yy yz zz about the center of mass, in body axes [kg m^2].

        Assigned values must be positive definite and keep the triangle inequality, as in a description.
        """
        return self._view("body_inertia")

    @body_inertia.setter
    def body_inertia(self, value: ArrayLike) -> None:
        self._assign("body_inertia", value, (len(self._bodies.names), 6), self._check_inertias)

    def has_own(self, name: str) -> bool:
        """Whether a parameter, such as "kp", is each environment's own, because it was read or assigned."""
        if name not in _PARAMETERS:
            raise ValueError(f"name is {name!r}; choose one of {', '.join(map(repr, _PARAMETERS))}")
        return name in self._views

    # Running

    def step(self, steps: int = 1) -> StepStatus:
        """Advances every environment by `steps` time steps; returns the status bits of all, or-ed.

        Never raises for what happens in a step. An environment whose inputs or result are not finite is flagged
        (`StepStatus.NON_FINITE`) and keeps its last finite state; `flagged` names it. Other Python threads run meanwhile.
        """
        return StepStatus(self._core.step(count("steps", steps)))

    def flagged(self, status: StepStatus | None = None) -> NDArray[np.int64]:
        """(k,) indices of environments whose status of the last `step` call has any of these bits; None: any at all."""
        if status is None:
            return np.flatnonzero(self.status)
        return np.flatnonzero(self.status & np.uint32(count("status", status)))

    def reset(self, where: ArrayLike | None = None, q: ArrayLike | None = None, u: ArrayLike | None = None) -> None:
        """Puts environments into a state and forgets their warm starts; clears their status, residual, impulses and time.

        where: boolean mask (num_envs,), or integer indices (k,); None for all.
        q, u: (k, nq) and (k, nu), one row per environment in the order of `where` (a mask: ascending), or (nq,) and (nu,)
            for all alike; None for what the world had when the batch was made.

        IndexError for an index out of range, ValueError for one that is there twice, a wrong shape, numbers that are not finite
        or a quaternion far from unit length (a near one is normalized); nothing changes then. Inputs and parameters stay.
        """
        if where is None:
            envs = np.arange(self._num_envs)
        else:
            envs = inputs.environments("where", where, self._num_envs)
        given = [
            np.empty(0) if value is None else inputs.states(name, value, len(envs), size, self._dtype).reshape(-1)
            for name, value, size in (("q", q, self._model.nq), ("u", u, self._model.nu))
        ]
        self._core.reset(envs, *given)

    def save_state(self) -> bytes:
        """Everything that changes in a step; `load_state` replays bit for bit. Inputs and parameters are not in it."""
        return self._core.save_state()

    def load_state(self, blob: bytes) -> None:
        """Goes back to a saved state. ValueError if it is not of such a batch; nothing changes then."""
        self._core.load_state(saved_state("blob", blob))

    # Memory and checks

    def _check_settable(self, name: str) -> None:
        """A mistyped name would be set and never read."""
        if hasattr(type(self), name):
            return
        near = difflib.get_close_matches(name, [known for known in dir(type(self)) if not known.startswith("_")], 1)
        raise AttributeError(f"a Batch has no {name!r}" + (f"; did you mean {near[0]!r}?" if near else ""))

    def _view(self, name: str) -> Array:
        """The one view of an array."""
        view = self._views.get(name)
        if view is None:
            view = self._core.array(name)
            if name == "contact_active":
                view = view.view(np.bool_)
            self._views[name] = view
        return view

    def _assign(
        self, name: str, value: ArrayLike, shape: tuple[int, ...], check: Callable[[str, Array], None] | None = None
    ) -> None:
        values = inputs.fitted(name, value, (self._num_envs, *shape))
        if check is not None and 0 not in shape:
            check(name, values)
        with np.errstate(over="ignore", invalid="ignore"):
            np.copyto(self._view(name), values, casting="same_kind")

    def _check_finite(self, columns: Columns) -> Callable[[str, Array], None]:
        return lambda name, values: inputs.check_finite(name, values, self._dtype, columns)

    def _check_not_negative(self, columns: Columns) -> Callable[[str, Array], None]:
        def check(name: str, values: Array) -> None:
            inputs.check_finite(name, values, self._dtype, columns)
            inputs.check_not_negative(name, values, columns)

        return check

    def _check_masses(self, name: str, values: Array) -> None:
        inputs.check_finite(name, values, self._dtype, self._bodies)
        inputs.check_masses(name, inputs.cast(values, self._dtype), self._moves, self._bodies)

    def _check_inertias(self, name: str, values: Array) -> None:
        inputs.check_finite(name, values, self._dtype, self._bodies)
        inputs.check_inertias(name, values, self._moves, self._bodies)

    def _check_q(self, name: str, values: Array) -> None:
        inputs.check_finite(name, values, self._dtype, Columns("coordinate", range(self._model.nq)))
        if self._model.base == "floating":
            inputs.check_quaternions(name, values, self._model.nq)


def _precision(dtype: DTypeLike) -> np.dtype:
    try:
        name = "" if dtype is None else np.dtype(dtype).name
    except TypeError:
        name = ""
    if name not in _PRECISIONS:
        raise ValueError(f"dtype is {dtype!r}; choose one of {', '.join(map(repr, _PRECISIONS))}")
    return np.dtype(name)
