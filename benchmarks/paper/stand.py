"""The paper's stand, simulated: a rig and a manoeuvre become the recording that its encoder and camera would make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from discovery_datasets.disturbances import Disturbance
from discovery_datasets.manoeuvres import Manoeuvre, trapezoid
from discovery_datasets.twin import PAPER_RIG, ArmRig, TwinMotion, record, simulate
from numpy.typing import NDArray

from discovery.recordings.experiment import Experiment, make_experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Quantity, Rig

FloatArray = NDArray[np.float64]

DURATION, RATE = 30.0, 100.0
"""Length of a recording [s] and its sample rate [Hz]; the paper states neither."""
POSITION_NOISE, ANGLE_NOISE = 3e-4, 7e-5
"""Camera, standard deviation per axis [m], and encoder, half width of a uniform error [rad] (P10)."""
SPEED = 1.4
"""Speed of the 1 rad manoeuvre [rad/s] at which the arm reaches the paper's deflection, see erratum f."""
#: Relative standard deviations of length, tip mass, rod mass and rigidity: those of a rig file without its own.
_SPREAD = (0.001, 0.01, 0.02, 0.05)


@dataclass(frozen=True)
class Stand:
    """One recording of the twin, and what is known of it.

    Parameters
    ----------
    arm : ArmRig
        The rig that was simulated.
    motion : TwinMotion
        Its motion, free of noise.
    experiment : Experiment
        The recording, its input made smooth.
    """

    arm: ArmRig
    motion: TwinMotion
    experiment: Experiment

    @cached_property
    def tip(self) -> FloatArray:
        """Tip without noise [m], shape (n, 2)."""
        return np.column_stack([self.motion.tip_x, self.motion.tip_y])

    @property
    def reached(self) -> float:
        """Largest deflection [rad]."""
        return float(np.abs(self.motion.deflection).max())

    def shortened(self, duration: float) -> Stand:
        """Return the first seconds of the recording alone."""
        r = self.experiment.recording
        stop = int(np.searchsorted(r.time, duration * (1 + 1e-9), side="right"))
        assert r.input is not None
        part = replace(r, time=r.time[:stop], input=r.input[:stop], output=r.output[:stop])
        motion = replace(self.motion, **{n: getattr(self.motion, n)[:stop] for n in self.motion.__dataclass_fields__})
        return Stand(self.arm, motion, make_experiment(part, self.experiment.rig))

    def of_angle(self) -> Experiment:
        """Return the recording of the tip's angle alone, which is what the paper fits (13) and (15) to."""
        r = self.experiment.recording
        angle = np.unwrap(np.arctan2(r.output[:, 1], r.output[:, 0]))[:, None]
        noise = np.array([POSITION_NOISE / self.arm.length])
        return replace(
            self.experiment,
            recording=replace(r, output=angle, channels=("tip_angle",), units=("rad",), noise=noise),
        )


def manoeuvre(speed: float = SPEED, angle: float = 1.0) -> Manoeuvre:
    """Return the paper's manoeuvre (P11): `angle` [rad] at `speed` [rad/s], trapezoidal, ramps of 12 % of the move."""
    return trapezoid(angle, speed)


def scaled_rig(arm: ArmRig = PAPER_RIG, *, friction: float | None = None, **changes: float) -> ArmRig:
    """Return a rig with changed quantities whose friction over effective mass is `friction` [1/s], or as before."""
    changed = replace(arm, **changes)
    rate = arm.disc_friction / arm.effective_mass if friction is None else friction
    return replace(changed, disc_friction=rate * changed.effective_mass)


def as_rig(arm: ArmRig, name: str = "fibreglass arm") -> Rig:
    """Return what an experimenter's rig file says of an arm."""
    values = (arm.length, arm.tip_mass, arm.beam_mass, arm.flexural_rigidity)
    length, tip, rod, rigidity = (Quantity(v, s * v) for v, s in zip(values, _SPREAD, strict=True))
    return Rig(
        name=name,
        length=length,
        tip_mass=tip,
        beam_mass=rod,
        flexural_rigidity=rigidity,
        position_noise=POSITION_NOISE,
        angle_noise=ANGLE_NOISE,
    )


def stand(
    arm: ArmRig,
    move: Manoeuvre,
    *,
    name: str,
    seed: Sequence[int],
    duration: float = DURATION,
    rate: float = RATE,
    disturbances: Sequence[Disturbance] = (),
    rtol: float = 1e-6,
) -> Stand:
    """Simulate and record one manoeuvre.

    Parameters
    ----------
    arm : ArmRig
        The rig as built.
    move : Manoeuvre
        Motion of the motor.
    name : str
        Name of the recording.
    seed : sequence of int
        Of the instruments' noise.
    duration, rate : float
        Of the recording [s], [Hz].
    disturbances : sequence of Disturbance
        Effects that the twin has beside the arm's own mechanics.
    rtol : float
        Of the twin's integrator; the tip is then within 0.001 mm of that at 1e-9.
    """
    time = np.arange(round(duration * rate) + 1) / rate
    motion = simulate(arm, move, time, disturbances=disturbances, rtol=rtol)
    frame = record(motion, rng=np.random.default_rng(seed), position_noise=POSITION_NOISE, angle_noise=ANGLE_NOISE)
    recording = Recording(
        name=name,
        time=time,
        input=frame["motor_angle_rad"].to_numpy(),
        output=frame[["tip_x_m", "tip_y_m"]].to_numpy(),
        channels=("tip_x", "tip_y"),
        units=("m", "m"),
        noise=np.full(2, POSITION_NOISE),
        sha256="",
        source=f"twin, seed {list(seed)}",
    )
    return Stand(arm, motion, make_experiment(recording, as_rig(arm)))
