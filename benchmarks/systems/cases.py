"""Which machine lacks which effect, and what counts as an answer."""

from __future__ import annotations

from dataclasses import dataclass, replace

from benchmarks.systems import laws, machines
from benchmarks.systems.laws import Law
from benchmarks.systems.machines import Machine


@dataclass(frozen=True)
class Case:
    """A machine with one effect at a joint.

    Parameters
    ----------
    machine : Machine
        The machine.
    joint : str
        Where the effect acts; empty for one of the drive.
    law : Law
        The effect.
    within : float
        Relative error that its parameters may have.
    """

    machine: Machine
    joint: str
    law: Law
    within: float = 0.05


CASES = {
    "servo: play of 40 mrad": Case(machines.servo(), "joint", laws.play(0.020, 45.0, 0.012)),
    "servo: dry friction at the load": Case(machines.servo(), "load", laws.dry(0.02, 2e-3)),
    "servo: dry friction at the motor": Case(machines.servo(), "motor", laws.dry(0.03, 2e-3)),
    "servo: dead zone of the amplifier": Case(machines.servo(), "", laws.dead_zone(0.3)),
    "two masses: torque that saturates": Case(machines.two_masses(), "", laws.saturation(0.14)),
    "two masses: torque that lags by 8 ms": Case(machines.two_masses(), "", laws.lag(8e-3)),
    "two masses: dry friction at the load": Case(machines.two_masses(), "load", laws.dry(0.012, 2e-3)),
    "two masses: cubic spring in the shaft": Case(machines.two_masses(), "joint", laws.cubic(2.5e4)),
    "two masses: hysteresis in the shaft": Case(machines.two_masses(), "joint", laws.hysteresis(2.5, 4e-3), within=0.2),
    # The parts rattle in the gap: after some 6 s a change of the gap by 0.1 % moves the load by ten times its noise.
    "two masses: play in the shaft": Case(
        replace(machines.two_masses(), seconds=6.0), "joint", laws.play(0.004, 7.5, 4e-3)
    ),
    "cart pendulum: dry friction at the pivot": Case(machines.cart_pendulum(), "pivot", laws.dry(4e-3, 2e-3)),
    "cart pendulum: dry friction on the track": Case(machines.cart_pendulum(), "track", laws.dry(0.4, 1e-3)),
    "cart pendulum: drag of the cart": Case(machines.cart_pendulum(), "track", laws.drag(1.5), within=0.1),
    "Furuta pendulum: dry friction at the pivot": Case(machines.furuta_pendulum(), "pivot", laws.dry(4e-4, 2e-3)),
    "Furuta pendulum: dry friction at the axis": Case(machines.furuta_pendulum(), "axis", laws.dry(4e-3, 2e-3)),
    "Furuta pendulum: drag of the pendulum": Case(machines.furuta_pendulum(), "pivot", laws.drag(2e-4), within=0.1),
    "quarter car: damper that differs both ways": Case(
        machines.quarter_car(), "suspension", laws.lopsided(350.0, 1150.0)
    ),
    "quarter car: damper with a square": Case(machines.quarter_car(), "suspension", laws.drag(900.0)),
    "quarter car: dry friction": Case(machines.quarter_car(), "suspension", laws.dry(60.0, 1e-3)),
    "motor, speed: nothing": Case(machines.motor(), "shaft", laws.NOTHING),
    "motor, speed: dry friction": Case(machines.motor(), "shaft", laws.dry(8e-3, 0.01)),
    "motor, speed: cogging": Case(machines.motor(), "shaft", laws.cogging(0.015, 18.0)),
    "motor, speed: torque that lags by 0.1 s": Case(machines.motor(), "", laws.lag(0.1)),
    "motor, position: nothing": Case(machines.motor("drive"), "shaft", laws.NOTHING),
    "motor, position: dry friction": Case(machines.motor("drive"), "shaft", laws.dry(8e-3, 0.01)),
}
