"""Worlds: gravity, a ground plane, robots. Double precision, one thread.

A world and its robots belong to one thread at a time; different worlds can step in different threads.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip import _core
from stickslip._arguments import array, count, number, saved_state
from stickslip._core import Model, Pose, load_urdf
from stickslip._profiling import Profiled
from stickslip.contact import ContactProblem
from stickslip.reports import Contact, SolveInfo, StageTimes, StepStatus

if TYPE_CHECKING:
    from stickslip.recording import Recorder

__all__ = ["Contact", "Robot", "SolveInfo", "StageTimes", "StepError", "StepStatus", "World"]

Array = NDArray[np.float64]


class StepError(FloatingPointError):
    """A robot's velocities overflowed. It was left in its last finite state; `robots` names it."""

    def __init__(self, message: str, robots: list[str]):
        super().__init__(message)
        self.robots = robots


def _read_only(values: Array) -> Array:
    """Marks a copy as one: assigning to its elements would not reach the robot."""
    values.flags.writeable = False
    return values


class Robot:
    """A robot in a world; made by `World.add_robot`. Arrays that it returns are copies, read-only where the name can be set."""

    def __init__(self, core: _core.Robot, world: World):
        self._core = core
        self._world = world
        self._model: Model = core.model
        self._body_names = [body.name for body in self._model.bodies]
        self._shape_names = [shape.name for shape in self._model.shapes]

    def __repr__(self) -> str:
        return f"<stickslip.Robot {self.name!r}: {self.nu} degrees of freedom, {self.mass:.4g} kg>"

    def __reduce__(self) -> NoReturn:
        raise TypeError("a Robot belongs to its World and can be neither copied nor pickled; pass q and u")

    @property
    def name(self) -> str:
        """Its name in the world."""
        return self._core.name

    @property
    def model(self) -> Model:
        """Its description."""
        return self._model

    @property
    def mass(self) -> float:
        """Of all bodies; of a fixed base, without the base [kg]."""
        return self._model.mass

    @property
    def joint_names(self) -> list[str]:
        """In the order of `q` and `u`."""
        return self._model.joint_names

    @property
    def frame_names(self) -> list[str]:
        """What `jacobian` and `frame_pose` know: every link of the description."""
        return self._model.frame_names

    @property
    def nq(self) -> int:
        """Length of `q`."""
        return self._model.nq

    @property
    def nu(self) -> int:
        """Length of `u`."""
        return self._model.nu

    @property
    def num_joints(self) -> int:
        """Moving joints."""
        return self._model.num_joints

    # State

    @property
    def q(self) -> Array:
        """(nq,) base position [m], base quaternion w x y z, joints [rad or m]; a copy, see `set_state`."""
        return _read_only(self._core.q)

    @property
    def u(self) -> Array:
        """(nu,) base linear [m/s] and angular velocity [rad/s] of the base origin in world axes, joint rates; a copy."""
        return _read_only(self._core.u)

    def set_state(self, q: ArrayLike, u: ArrayLike) -> None:
        """Sets position (nq,) and velocity (nu,), and forgets warm-start impulses.

        ValueError for wrong lengths, numbers that are not finite, or a quaternion far from unit length (a near one is
        normalized).
        """
        self._core.set_state(array("q", q, (self.nq,)), array("u", u, (self.nu,)))

    # Control

    @property
    def generalized_force(self) -> Array:
        """(nu,) [N, N m], acts until it is set again; assign a whole array."""
        return _read_only(self._core.generalized_force)

    @generalized_force.setter
    def generalized_force(self, tau: ArrayLike) -> None:
        self._core.generalized_force = array("generalized_force", tau, (self.nu,))

    def set_pd_gains(self, kp: ArrayLike, kd: ArrayLike) -> None:
        """Joint control tau = kp (pd_target - q) - kd u, taken implicitly: no gain is too stiff for the step.

        kp [N m/rad or N/m] and kd [N m s/rad or N s/m]: numbers, or one per joint; zero or positive.
        """
        self._core.set_pd_gains(self._per_joint("kp", kp), self._per_joint("kd", kd))

    @property
    def pd_gains(self) -> tuple[Array, Array]:
        """kp (num_joints,) and kd (num_joints,)."""
        return _read_only(self._core.pd_kp), _read_only(self._core.pd_kd)

    @property
    def pd_target(self) -> Array:
        """(num_joints,) [rad or m]; assign a whole array."""
        return _read_only(self._core.pd_target)

    @pd_target.setter
    def pd_target(self, target: ArrayLike) -> None:
        self._core.pd_target = array("pd_target", target, (self.num_joints,))

    def _per_joint(self, name: str, value: ArrayLike) -> Array:
        if np.ndim(value) == 0:
            return np.full(self.num_joints, number(name, value))
        return array(name, value, (self.num_joints,))

    # Dynamics at the present state

    def mass_matrix(self) -> Array:
        """(nu, nu) [kg, kg m, kg m^2]."""
        return self._core.mass_matrix()

    def bias_force(self) -> Array:
        """(nu,) h in `M du/dt + h = tau`: gravity, Coriolis and centrifugal forces, without damping and control [N, N m]."""
        return self._core.bias_force()

    def forward_dynamics(self, tau: ArrayLike) -> Array:
        """(nu,) acceleration du/dt [m/s^2, rad/s^2] without contacts, for generalized forces tau (nu,) [N, N m]."""
        return self._core.forward_dynamics(array("tau", tau, (self.nu,)))

    def jacobian(self, frame: str) -> Array:
        """(6, nu): rows 0-2 give the velocity of the frame's origin, rows 3-5 its angular velocity, in world axes.

        ValueError for an unknown frame lists the names.
        """
        return self._core.jacobian(frame)

    def frame_pose(self, frame: str) -> Pose:
        """Position and rotation of a frame in the world. ValueError for an unknown frame lists the names."""
        return self._core.frame_pose(frame)

    def delassus(self, bodies: Sequence[str | int], points: ArrayLike) -> Array:
        """(3n, 3n) J M^-1 J^T [1/kg] of n points (n, 3) [m] in world axes, each fixed to a body given by name or index."""
        indices = [self._model.body_index(body) if isinstance(body, str) else count("bodies", body) for body in bodies]
        for index in indices:
            if index >= len(self._body_names):
                raise ValueError(f"bodies: {index} is not a body; {self.name} has {len(self._body_names)}")
        return self._core.delassus(indices, array("points", points, (len(indices), 3)).tolist())

    @property
    def mechanical_energy(self) -> float:
        """Kinetic plus potential energy at the time of `q`, as the integrator accounts for it [J].

        While in contact, `u` of the energy-safe step lacks half a step of gravity; this adds it. Contacts never make it grow.
        """
        return self._core.mechanical_energy

    @property
    def kinetic_energy(self) -> float:
        """Of the velocity `u` [J]."""
        return self._core.kinetic_energy

    @property
    def potential_energy(self) -> float:
        """Of all bodies in the world's gravity [J], zero at the world's origin."""
        return self._core.potential_energy

    @property
    def center_of_mass(self) -> Array:
        """(3,) world [m]."""
        return self._core.center_of_mass

    @property
    def linear_momentum(self) -> Array:
        """(3,) world [kg m/s]."""
        return self._core.linear_momentum

    @property
    def angular_momentum(self) -> Array:
        """(3,) about the center of mass, world axes [kg m^2/s]."""
        return self._core.angular_momentum

    # The last step

    @property
    def contacts(self) -> list[Contact]:
        """Contact points of the last step."""
        return [
            Contact(
                robot=self.name,
                body=self._body_names[c.body],
                shape=self._shape_names[c.shape],
                point=c.point,
                position=c.position,
                normal=c.normal,
                gap=c.gap,
                friction=c.friction,
                impulse=c.impulse,
                velocity=c.velocity,
            )
            for c in self._core.contacts
        ]

    @property
    def solve_info(self) -> SolveInfo:
        """What the last step did for this robot."""
        i = self._core.info
        return SolveInfo(StepStatus(i.status), i.contacts, i.sweeps, i.newton_steps, i.substeps, i.residual)

    def next_contact_problem(self) -> ContactProblem:
        """The contact problem that the next step would solve (its last substep), for `stickslip.solve`; empty without contacts.

        Forgets the `contacts` of the last step.
        """
        index = self._world.robots.index(self)
        return ContactProblem(*self._world._core.next_contact_problem(index))


class World(Profiled):
    """One scene.

    time_step: [s]
    gravity: (3,) [m/s^2]
    integrator: "energy_safe" neither sinks nor explodes at large steps; "semi_implicit" is the paper's scheme (a contact is
        active when its gap is negative, no correction of positions).
    method: how contact impulses are found, "auto", "per_contact" ([Hwangbo 2018] Algorithm 2) or "pgs".
    law: "coulomb" (friction opposite to sliding) or "max_dissipation" ([Hwangbo 2018] eq. 8).
    single_contact: "halley", "bisection", "golden_section" or "quartic"; for "per_contact".
    tolerance: where the contact solve stops. "auto": the change of the contact velocities in a sweep [m/s], added to
        relative_tolerance times the largest contact speed, at most 1e-8 (with both at their defaults or above, also the
        change that the next sweep is expected to make), or, at every third sweep, a residual far below the allowed one; it has
        converged when the largest contact residual is at most 1e-8 m/s. "per_contact": the paper's sum of what each contact
        violates of its law [m/s]. "pgs": the paper's sum of impulse updates [N s] and penetration velocities [m/s].
    max_sweeps, alpha, alpha_min, gamma: of "per_contact" (and alpha of "pgs"), as in `stickslip.solve`.
    warm_start: start each solve at the last step's impulses ("auto" with "semi_implicit": where those of the last two point).
    max_substeps: "energy_safe" cuts a step into at most this many parts when bodies turn fast.

    ValueError names the option that is out of range.
    """

    def __init__(
        self,
        time_step: float = 1e-3,
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        *,
        integrator: str = "energy_safe",
        method: str = "auto",
        law: str = "coulomb",
        single_contact: str = "halley",
        tolerance: float = 1e-9,
        relative_tolerance: float = 1e-8,
        max_sweeps: int = 100_000,
        alpha: float = 1.0,
        alpha_min: float = 0.7,
        gamma: float = 0.99,
        warm_start: bool = True,
        max_substeps: int = 8,
    ):
        self._core = _core.World(
            time_step=number("time_step", time_step),
            gravity=array("gravity", gravity, (3,)).tolist(),
            integrator=integrator,
            max_substeps=count("max_substeps", max_substeps),
            method=method,
            law=law,
            single_contact=single_contact,
            tolerance=number("tolerance", tolerance),
            relative_tolerance=number("relative_tolerance", relative_tolerance),
            max_sweeps=count("max_sweeps", max_sweeps),
            alpha=number("alpha", alpha),
            alpha_min=number("alpha_min", alpha_min),
            gamma=number("gamma", gamma),
            warm_start=bool(warm_start),
        )
        self._method, self._law = method, law
        self._robots: list[Robot] = []
        self._stepper: _core.World | Recorder = self._core

    def __reduce__(self) -> NoReturn:
        raise TypeError(  # for copy, deepcopy and pickle alike
            "a World can be neither copied nor pickled; make another one in the same way, and pass the state with "
            "save_state() and load_state()"
        )

    def __repr__(self) -> str:
        robots = ", ".join(robot.name for robot in self._robots) or "no robots"
        return f"<stickslip.World at {self.time:.6g} s: {robots}>"

    # Building

    def add_ground(self, height: float = 0.0, material: str = "default") -> None:
        """A horizontal plane that fills everything below z = height [m]. ValueError for a second one."""
        self._core.add_ground(number("height", height), material)

    def add_robot(
        self,
        robot: str | os.PathLike[str] | Model,
        *,
        position: ArrayLike = (0.0, 0.0, 0.0),
        orientation: ArrayLike = (1.0, 0.0, 0.0, 0.0),
        base: str | None = None,
        name: str = "",
        material: str = "default",
    ) -> Robot:
        """Adds a robot, joints at zero, from a URDF file or a `Model`.

        position: (3,) of the base [m]; orientation: (4,) quaternion w x y z of the base (normalized); both of a fixed base too.
        base: "floating" (default for a file) or "fixed"; a `Model` has its own.
        name: empty for the model's name, made unique. material: of its shapes, see `set_material_pair`.

        FileNotFoundError or ValueError names the file, the element or the argument; the world is then as before. A UserWarning
        names what is not simulated as described, shapes that take part in no contact among it.
        """
        place = array("position", position, (3,)).tolist()
        turn = array("orientation", orientation, (4,)).tolist()
        model = _model(robot, base)
        _warn(model)  # before the world changes: a warning may be turned into an error
        core = self._core.add_robot(model, name, place, turn, material)
        self._robots.append(Robot(core, self))
        return self._robots[-1]

    def set_material_pair(
        self, a: str, b: str, *, friction: float = 0.8, restitution: float = 0.0, restitution_threshold: float = 0.0
    ) -> None:
        """Sets how two materials meet (in either order), now and for what is added later.

        friction: Coulomb's coefficient [1], >= 0. restitution: Newton's, 0 to 1 [1]. restitution_threshold: approach speed
        below which a contact does not bounce [m/s]. Pairs that were never set have the defaults.
        """
        self._core.set_material_pair(
            a,
            b,
            number("friction", friction),
            number("restitution", restitution),
            number("restitution_threshold", restitution_threshold),
        )

    # Running

    @property
    def robots(self) -> list[Robot]:
        """In the order in which they were added."""
        return list(self._robots)

    @property
    def time(self) -> float:
        """Since the world was made [s]."""
        return self._core.time

    @property
    def time_step(self) -> float:
        """Length of a step [s]."""
        return self._core.time_step

    @property
    def gravity(self) -> Array:
        """(3,) acceleration by gravity, world axes [m/s^2]."""
        return self._core.gravity

    @property
    def integrator(self) -> str:
        """ "energy_safe" or "semi_implicit"."""
        return self._core.integrator

    def step(self, steps: int = 1) -> StepStatus:
        """Advances every robot by `steps` time steps; returns the status bits of all of them, or-ed.

        StepError when a robot's velocities overflow: the stepping ends there, `time` says where.
        """
        bits, done = self._stepper.step(count("steps", steps))
        status = StepStatus(bits)
        if StepStatus.NON_FINITE in status:
            names = [robot.name for robot in self._robots if StepStatus.NON_FINITE in robot.solve_info.status]
            raise StepError(
                f"{', '.join(names)}: forces or velocities overflowed in step {done} of {steps} (time {self.time:.6g} s) "
                "and the robot was left in its last finite state; use a smaller step, or smaller forces or gains",
                names,
            )
        return status

    def record_contact_problems(self, path: str | os.PathLike[str] | None, every: int = 1) -> None:
        """From now on writes the contact problems of every `every`-th step that has contacts to FCLIB files; None stops it.

        path: a folder (made if missing), or a pattern of file names with {number} (counts the recorded steps, on from the files
            that are there, so that none is replaced), {robot}, {index}, {step} and {time} [s] of the world, as in
            "drop/{number:06d}_{robot}.hdf5". One file per robot.

        The solver's impulse and velocity are the file's solution, texts say time, robot, law and residual. Steps have the same
        bits with and without recording. ValueError for a bad pattern or `every`; OSError from here or `step` where it cannot write.
        """
        if path is None:
            self._stepper = self._core
            return
        from stickslip.recording import Recorder  # imports HDF5 and SciPy, which stepping does without

        self._stepper = Recorder(self, path, every)

    @property
    def contacts(self) -> list[Contact]:
        """Contact points of the last step, of all robots."""
        return [contact for robot in self._robots for contact in robot.contacts]

    @property
    def solve_info(self) -> SolveInfo:
        """What the last step did: status bits or-ed, contacts summed, the largest of everything else."""
        infos = [robot.solve_info for robot in self._robots]
        status = StepStatus.OK
        for info in infos:
            status |= info.status
        return SolveInfo(
            status=status,
            contacts=sum(info.contacts for info in infos),
            sweeps=max((info.sweeps for info in infos), default=0),
            newton_steps=max((info.newton_steps for info in infos), default=0),
            substeps=max((info.substeps for info in infos), default=1),
            residual=max((info.residual for info in infos), default=0.0),
        )

    def save_state(self) -> bytes:
        """Everything that changes in a step; `load_state` replays bit for bit. Forces, gains and targets are not in it."""
        return self._core.save_state()

    def load_state(self, blob: bytes) -> None:
        """Goes back to a saved state. ValueError if it is not of a world with the same robots; nothing changes then."""
        self._core.load_state(saved_state("blob", blob))


def _model(robot: str | os.PathLike[str] | Model, base: str | None) -> Model:
    if isinstance(robot, Model):
        if base not in (None, robot.base):
            raise ValueError(f"base is {base!r}, but the model {robot.name!r} was made with base={robot.base!r}")
        return robot
    if not isinstance(robot, (str, os.PathLike)):
        raise TypeError(f"robot is a {type(robot).__name__}; a path to a URDF file or a Model is wanted")
    return load_urdf(robot, base="floating" if base is None else base)


def _warn(model: Model) -> None:
    """Says what of a model is not simulated as described."""
    shapes = model.shapes
    silent = [f"{shapes[i].name} ({shapes[i].type})" for i in _core.unsupported_shapes(model)]
    messages = [f"{model.name}: {message}" for message in model.warnings]
    if silent:
        shown = ", ".join(silent[:6]) + (f" and {len(silent) - 6} more" if len(silent) > 6 else "")
        messages.append(
            f"{model.name}: these collision shapes take part in no contact, meshes are not supported yet: {shown}"
        )
    for message in messages:
        warnings.warn(message, UserWarning, stacklevel=3)
