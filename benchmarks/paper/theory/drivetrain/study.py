r"""When the encoder angle may be taken as a given input, and when the command instead of it.

The encoder always may: the rod is clamped to the hub, and whatever the motor does, the arm feels the hub's motion and
nothing else of it. A measured hub motion is a complete input; motor, gear and controller drop out of the arm's
equation, and so do their errors. This holds as long as the encoder's error is small beside what it measures and
nothing moves between encoder and clamp: an encoder on the motor's shaft does not see the gear's play and twist.

The command may be used instead only where the motor is deaf to the arm. Under a controller of bandwidth omega_b the
coupling torque moves the hub, slowly enough, by

.. math:: \Delta\theta_m \approx -\frac{\Gamma_c}{J n^2 \omega_b^2},

so that it falls with the gear ratio squared. Gamma_c is about -alpha delta m l^2: the controller is a spring in series
with the rod, and a fit that takes the command as input finds both, ``alpha (1 - alpha m l^2 / (J n^2 omega_b^2))``.
What counts is therefore the controller's stiffness beside the arm's, not the ratio of the inertias alone.
It fits well all the same: the residual does not warn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.theory.arm_motion import move_arm
from benchmarks.paper.theory.coupling import Arm
from benchmarks.paper.theory.drivetrain.driven_arm import DrivenMotion, drive_arm
from benchmarks.paper.theory.drivetrain.motor import ASSUMED_MOTOR, Motor, PositionController
from discovery.equations.model import Model
from discovery.estimation.fit import fit
from discovery.foundation.errors import InputError
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment, make_experiment
from discovery.recordings.recording import Recording
from discovery.rigs.kinds import PAPER_MODEL
from discovery.rigs.rig import Quantity, Rig

FloatArray = NDArray[np.float64]

GEAR_RATIOS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
#: The paper's arm with the paper's fit, rod massless as there.
PAPER_ARM = Arm(
    Model("constant_radius", PAPER_MODEL, {"length": 1.0}),
    {"xi": 0.0458, "alpha": 8.7907, "beta": 0.5139, "gamma": 0.4462},
    0.04376,
)
#: Ten hertz, without overshoot.
_CONTROLLER = PositionController(2 * np.pi * 10)
#: Of the paper's rig: standard deviation of the camera [m], half width of the encoder's error [rad].
_CAMERA, _ENCODER = 3e-4, 7e-5


def trapezoid_command(angle: float, speed: float, *, start: float = 0.5, ramp: float = 0.12) -> Drive:
    """Return a move with a trapezoidal speed, as the paper's manoeuvre is.

    Parameters
    ----------
    angle, speed : float
        Of the move [rad] and of its plateau, positive [rad/s].
    start : float
        Beginning of the move [s].
    ramp : float
        Duration of each ramp over that of the move, up to 0.5.

    Raises
    ------
    InputError
        If angle or speed is not positive, or the ramp not in (0, 0.5].
    """
    if not (angle > 0 and speed > 0 and 0 < ramp <= 0.5):
        raise InputError(
            f"A move needs a positive angle and speed and a ramp in (0, 0.5]; got {angle:g} rad, {speed:g} rad/s and "
            f"{ramp:g}."
        )
    duration = angle / speed / (1 - ramp)
    rise = ramp * duration
    half = speed / rise / 2
    corner = speed * rise / 2
    breaks = start + np.array([0.0, rise, duration - rise, duration])
    pieces = np.array([[half, 0.0, 0.0], [0.0, speed, corner], [-half, speed, angle - corner]])
    return Drive(breaks, pieces.T, breaks)


@dataclass(frozen=True)
class EncoderStudy:
    """What the motor does to the arm's input, by gear ratio, shapes (n,).

    Attributes
    ----------
    gear_ratio, inertia_ratio : ndarray
        n, and J n^2 / (m_eff l^2) [-].
    stiffness_ratio : ndarray
        Stiffness of the controller over that of the arm, J n^2 omega_b^2 / (alpha m_eff l^2) [-].
    hub_rms, hub_peak : ndarray
        Deviation of the hub that the arm causes: coupling on minus coupling off [rad].
    hub_predicted : ndarray
        Peak of |Gamma_c| / (J n^2 omega_b^2) with the motor deaf to the arm [rad].
    tip_mean, tip_peak : ndarray
        Distance of the tip from where it would be if the hub followed its command [m].
    bias_command, bias_encoder : ndarray
        Relative error of the fitted alpha with the command and with the encoder's readings as input [-]; nearly -1
        where the motor holds so weakly that the fit ends at alpha's lower bound.
    sd_encoder : ndarray
        Relative standard deviation of alpha with the encoder as input and the camera's noise [-].
    residual_command, residual_encoder : ndarray
        Root mean square distance that the two fits leave [m].
    """

    gear_ratio: FloatArray
    inertia_ratio: FloatArray
    stiffness_ratio: FloatArray
    hub_rms: FloatArray
    hub_peak: FloatArray
    hub_predicted: FloatArray
    tip_mean: FloatArray
    tip_peak: FloatArray
    bias_command: FloatArray
    bias_encoder: FloatArray
    sd_encoder: FloatArray
    residual_command: FloatArray
    residual_encoder: FloatArray


def _fitted_alpha(arm: Arm, experiment: Experiment) -> tuple[float, float, float]:
    """Return alpha's relative error and standard deviation, and the distance that the fit leaves [m]."""
    model = Model(arm.model.base, arm.model.effects, arm.model.known)
    result = fit(model, [experiment], start={n: arm.values[n] for n in model.free})
    distance = np.linalg.norm(result.predict()[0] - experiment.recording.output, axis=1)
    true = arm.values["alpha"]
    return result.values["alpha"] / true - 1, result.sd["alpha"] / true, float(np.sqrt(np.mean(distance**2)))


def _recording(motion: DrivenMotion, angle: FloatArray) -> Recording:
    tip = np.column_stack([motion.x, motion.y])
    return Recording(
        "driven",
        motion.time,
        input=angle,
        output=tip,
        channels=("tip_x", "tip_y"),
        units=("m", "m"),
        noise=np.full(2, _CAMERA),
        sha256="",
        source="",
    )


def _felt(
    arm: Arm, motor: Motor, controller: PositionController, motion: DrivenMotion, alone: DrivenMotion
) -> tuple[float, ...]:
    """Return hub inertia and stiffness of the control over the arm's, and how far the arm moves the hub [rad]."""
    moved = motion.theta_m - alone.theta_m
    stiffness = motor.hub_inertia * controller.bandwidth**2
    return (
        motor.hub_inertia / arm.inertia,
        stiffness / (arm.values["alpha"] * arm.inertia),
        np.sqrt(np.mean(moved**2)),
        np.abs(moved).max(),
        np.abs(alone.coupling_torque).max() / stiffness,
    )


def encoder_as_input(
    rng: np.random.Generator,
    *,
    arm: Arm = PAPER_ARM,
    motor: Motor = ASSUMED_MOTOR,
    controller: PositionController = _CONTROLLER,
    command: Drive | None = None,
    time: FloatArray | None = None,
    gear_ratios: Sequence[float] = GEAR_RATIOS,
) -> EncoderStudy:
    """Drive an arm through motors of several gear ratios, and fit it with the command and with the encoder as input.

    The fitted model is the one that moved the arm, its true values are the start, and the tip is read without noise:
    what is wrong with the fit comes from its input alone.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of the encoder's error, uniform within 7e-5 rad as in the paper.
    arm : Arm
        Any model with a linear stiffness; the paper's by default.
    motor : Motor
        Its gear ratio is replaced; inertia and friction stay those of the motor's shaft.
    controller : PositionController
        Its gains follow the motor's inertia at the hub, its bandwidth stays.
    command : Drive, optional
        Commanded angle; 1 rad at 1 rad/s by default (the paper's manoeuvre).
    time : ndarray, shape (k,), optional
        Sample times [s]; 10 s at 100 Hz by default.
    gear_ratios : sequence of float
        Values of n.

    Returns
    -------
    EncoderStudy

    Raises
    ------
    InputError
        If there is no gear ratio.
    SimulationFailure, ComputationError
        If a motion or a fit fails.
    """
    if not len(gear_ratios):
        raise InputError("The study needs at least one gear ratio.")
    command = trapezoid_command(1.0, 1.0) if command is None else command
    time = np.linspace(0.0, 10.0, 1001) if time is None else time
    length = float(arm.parameters[arm.program.parameters.index("length")])
    rig = Rig("driven arm", length=Quantity(length, 1e-3 * length), position_noise=_CAMERA, angle_noise=_ENCODER)
    ideal = move_arm(arm, command, time)
    rows = []
    for ratio in gear_ratios:
        geared = replace(motor, gear_ratio=float(ratio))
        motion = drive_arm(arm, geared, controller, command, time)
        read = motion.theta_m + rng.uniform(-_ENCODER, _ENCODER, time.size)
        commanded = _fitted_alpha(arm, Experiment(_recording(motion, motion.command), command, rig))
        encoded = _fitted_alpha(arm, make_experiment(_recording(motion, read), rig))
        alone = drive_arm(arm, geared, controller, command, time, coupled=False)
        distance = np.hypot(motion.x - ideal.x, motion.y - ideal.y)
        fitted = (commanded[0], *encoded[:2], commanded[2], encoded[2])
        rows.append((ratio, *_felt(arm, geared, controller, motion, alone), distance.mean(), distance.max(), *fitted))
    return EncoderStudy(*np.array(rows, float).T)
