"""Motor, gear and controller, and the torque with which the arm answers: equations (10) and (11) of the paper.

`motor` is what drives, `coupling` what it feels of the arm, `arm_motion` and `driven_arm` move the two, `study` says
when the encoder's angle is a given input. The names below load what they need when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from discovery.foundation.lazy import lazy_names as _lazy_names

if TYPE_CHECKING:
    from discovery.theory.drivetrain.arm_motion import fitted_coupling as fitted_coupling
    from discovery.theory.drivetrain.arm_motion import move_arm as move_arm
    from discovery.theory.drivetrain.coupling import Arm as Arm
    from discovery.theory.drivetrain.coupling import coupling_torque as coupling_torque
    from discovery.theory.drivetrain.coupling import effective_inertia as effective_inertia
    from discovery.theory.drivetrain.driven_arm import drive_arm as drive_arm
    from discovery.theory.drivetrain.motor import ASSUMED_MOTOR as ASSUMED_MOTOR
    from discovery.theory.drivetrain.motor import Motor as Motor
    from discovery.theory.drivetrain.motor import PositionController as PositionController
    from discovery.theory.drivetrain.study import encoder_as_input as encoder_as_input
    from discovery.theory.drivetrain.study import trapezoid_command as trapezoid_command

_HOMES = {
    "ASSUMED_MOTOR": "discovery.theory.drivetrain.motor:ASSUMED_MOTOR",
    "Arm": "discovery.theory.drivetrain.coupling:Arm",
    "Motor": "discovery.theory.drivetrain.motor:Motor",
    "PositionController": "discovery.theory.drivetrain.motor:PositionController",
    "coupling_torque": "discovery.theory.drivetrain.coupling:coupling_torque",
    "drive_arm": "discovery.theory.drivetrain.driven_arm:drive_arm",
    "effective_inertia": "discovery.theory.drivetrain.coupling:effective_inertia",
    "encoder_as_input": "discovery.theory.drivetrain.study:encoder_as_input",
    "fitted_coupling": "discovery.theory.drivetrain.arm_motion:fitted_coupling",
    "move_arm": "discovery.theory.drivetrain.arm_motion:move_arm",
    "trapezoid_command": "discovery.theory.drivetrain.study:trapezoid_command",
}

__all__ = list(_HOMES)
__getattr__, __dir__ = _lazy_names(__name__, _HOMES)
