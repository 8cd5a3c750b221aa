"""The arm's mechanics: a rig, its discretised beam, the disturbances in force, and the balance of forces.

The rod is an inextensible planar Euler-Bernoulli beam of any deflection with its own mass; at its tip sits a disc that
spins freely on a bearing, so that it adds a point mass, no moment, and a friction linear in its velocity.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from discovery_datasets.beam import Beam, discretise, inertia_and_load, kinematics, solve_free
from discovery_datasets.disturbances import Disturbance
from discovery_datasets.manoeuvres import Manoeuvre

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

MODES, NODES = 5, 12
ROD_SHARE = 33 / 140  # of a light rod's mass, felt at the tip in the first mode


class TwinError(Exception):
    """The simulation could not be completed; the message says at what time and why."""


@dataclass(frozen=True)
class ArmRig:
    """A flexible arm as built.

    Attributes
    ----------
    length : float
        Length of the rod [m].
    tip_mass, beam_mass : float
        Mass of the disc and of the whole rod [kg].
    flexural_rigidity : float
        EI [N m^2].
    disc_friction : float
        Viscous friction between disc and table [N s/m].
    retardation : float
        Kelvin-Voigt time of the rod's own material [s].
    """

    length: float
    tip_mass: float
    beam_mass: float
    flexural_rigidity: float
    disc_friction: float
    retardation: float = 0.0

    @property
    def effective_mass(self) -> float:
        """Tip mass plus 33/140 of the rod's, the usual single-mode value [kg]."""
        return self.tip_mass + ROD_SHARE * self.beam_mass


PAPER_RIG = ArmRig(
    length=1.0,
    tip_mass=0.04376,
    beam_mass=0.01245,
    flexural_rigidity=31.65e9 * 3.98e-12,
    disc_friction=0.0458 * (0.04376 + ROD_SHARE * 0.01245),
)
"""The rig of the paper, its friction chosen so that friction over effective mass is the paper's xi = 0.0458 1/s."""


@dataclass(frozen=True)
class Arm:
    """A rig with its discretisation and the disturbances in force.

    Attributes
    ----------
    rig : ArmRig
        The arm as built.
    beam : Beam
        Its discretisation.
    disturbances : tuple of Disturbance
        Effects in force.
    rest_angle : (n,) array
        Angle of the unloaded rod against its root at each node [rad].
    gravity : complex
        Acceleration of free fall in the plane, x + 1j y [m/s^2].
    retardation : float
        Kelvin-Voigt time of the rod [s].
    relaxation : tuple of float
        Relaxing part of the rigidity [-] and its relaxation time [s].
    """

    rig: ArmRig
    beam: Beam
    disturbances: tuple[Disturbance, ...]
    rest_angle: FloatArray
    gravity: complex
    retardation: float
    relaxation: tuple[float, float]

    @classmethod
    def of(cls, rig: ArmRig, disturbances: Sequence[Disturbance], modes: int, nodes: int) -> Arm:
        """Discretise a rig and collect what the disturbances change once for all.

        Raises
        ------
        ValueError
            For two relaxation times, and for a disturbance that only the compiled engine knows.
        """
        beam = discretise(rig.length, rig.beam_mass, rig.tip_mass, modes=modes, nodes=nodes)
        if foreign := [d.id for d in disturbances if d.quick_only]:
            raise ValueError(f"{foreign[0]} is known to the compiled engine alone; use discovery_datasets.quick")
        relaxing = [d.relaxation() for d in disturbances if d.relaxation()[0] != 0]
        if len(relaxing) > 1:
            raise ValueError("the twin's rod has one relaxation time; give a single viscoelastic disturbance")
        return cls(
            rig=rig,
            beam=beam,
            disturbances=tuple(disturbances),
            rest_angle=sum(d.rest_curvature() for d in disturbances) * rig.length * beam.position,
            gravity=sum((d.gravity() for d in disturbances), 0j),
            retardation=rig.retardation + sum(d.retardation_time() for d in disturbances),
            relaxation=relaxing[0] if relaxing else (0.0, 1.0),
        )

    def base(self, angle: float, rate: float, acceleration: float) -> tuple[float, float, float]:
        """Angle, rate and acceleration of the rod's root where the encoder reads the given ones."""
        for disturbance in self.disturbances:
            angle, rate, acceleration = disturbance.base_motion(angle, rate, acceleration)
        return angle, rate, acceleration

    def moment(self, time: float, q: FloatArray, rate: FloatArray, relaxed: FloatArray) -> FloatArray:
        """Generalised elastic force on each q_k [N m]."""
        rigidity = self.rig.flexural_rigidity
        for disturbance in self.disturbances:
            rigidity *= disturbance.stiffness_factor(time)
        strain, ratio = q, self.relaxation[0]
        if ratio:
            strain = (1 + ratio) * q - ratio * relaxed
        if self.retardation:
            strain = strain + self.retardation * rate
        return rigidity / self.rig.length * strain

    def balance(
        self, time: float, coordinates: FloatArray, rates: FloatArray, relaxed: FloatArray, load: complex = 0j
    ) -> tuple[FloatArray, FloatArray]:
        """Mass matrix (K + 1, K + 1) and total load (K + 1,) but for the motor's torque; `load` [N] acts on the tip."""
        b = self.beam
        theta, omega, tip, velocity = kinematics(
            b.angle_shapes, self.rest_angle, b.weights, b.length, coordinates, rates
        )
        force = load - self.rig.disc_friction * velocity
        for disturbance in self.disturbances:
            force += disturbance.tip_force(time, tip, velocity)
        mass, total = inertia_and_load(
            b.angle_shapes, b.weights, b.inertia, b.outboard, b.length, theta, omega, force, self.gravity
        )
        total[1:] -= self.moment(time, coordinates[1:], rates[1:], relaxed)
        return mass, total

    def derivative(self, manoeuvre: Manoeuvre, stretch: int) -> Callable[[float, FloatArray], FloatArray]:
        """Right-hand side of the state (q, dq/dt, and the relaxed q where the rod relaxes) on one stretch."""
        origin, powers = manoeuvre.stretch(stretch)
        c0, c1, c2, c3, c4, c5 = (*powers, *(0.0,) * (6 - len(powers)))
        size = self.beam.angle_shapes.shape[1]
        modes = size - 1
        relaxing = self.relaxation[0] != 0
        coordinates, rates = np.empty(size), np.empty(size)

        def right_hand_side(time: float, state: FloatArray) -> FloatArray:
            t = time - origin
            angle = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
            rate = c1 + t * (2 * c2 + t * (3 * c3 + t * (4 * c4 + t * 5 * c5)))
            acceleration = 2 * c2 + t * (6 * c3 + t * (12 * c4 + t * 20 * c5))
            coordinates[0], rates[0], acceleration = self.base(angle, rate, acceleration)
            coordinates[1:], rates[1:] = state[:modes], state[modes : 2 * modes]
            relaxed = state[2 * modes :] if relaxing else coordinates[1:]
            change = np.empty_like(state)
            change[:modes] = rates[1:]
            mass, load = self.balance(time, coordinates, rates, relaxed)
            change[modes : 2 * modes] = solve_free(mass, load, acceleration)
            if relaxing:
                change[2 * modes :] = (coordinates[1:] - relaxed) / self.relaxation[1]
            return change

        return right_hand_side

    def equilibrium(self, time: float, base_angle: float, load: complex = 0j) -> FloatArray:
        """Curvature coordinates (K,) at rest [rad], under a tip force `load` [N] and the steady disturbances."""
        size = self.beam.angle_shapes.shape[1]
        still = np.zeros(size)

        def imbalance(q: FloatArray) -> FloatArray:
            return self.balance(time, np.concatenate([[base_angle], q]), still, q, load)[1][1:]

        found = root(imbalance, np.zeros(size - 1), tol=1e-13)
        scale = self.rig.flexural_rigidity / self.rig.length
        if np.abs(imbalance(found.x)).max() > 1e-9 * scale:
            raise TwinError(f"no static equilibrium found at time {time} s: {found.message}")
        return found.x
