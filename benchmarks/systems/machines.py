"""The machines: rig file and equations of motion of each, the latter by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, sin
from textwrap import dedent

#: Force at a joint, from its name, displacement and rate.
Joints = Callable[[str, float, float], float]
#: Accelerations from input, coordinates, rates, and the force that a law makes at a joint.
Accelerations = Callable[[float, list[float], list[float], Joints], list[float]]


@dataclass(frozen=True)
class Machine:
    """A machine.

    Parameters
    ----------
    rig : str
        Its rig file; the columns are t, u and y.
    coordinates : int
        How many there are.
    accelerations : callable
        From input, coordinates, rates and the forces at joints.
    joints : mapping of str to tuple of float
        Displacement of each joint per coordinate.
    read : callable
        What the instrument reads, in the unit of the column, from coordinates, rates and accelerations.
    drive : (float, float, float)
        Amplitude of the input, lowest and highest frequency in it [Hz]; all zero for a free decay.
    noise : float
        Standard deviation of what is read, in the unit of the column.
    rate : float
        Samples a second [Hz].
    seconds : float
        Duration of a recording [s].
    start : tuple of float
        Coordinates at the start, zero where none are given.
    input_factor : float
        Units of the column in one SI unit of the input.
    """

    rig: str
    coordinates: int
    accelerations: Accelerations
    joints: dict[str, tuple[float, ...]]
    read: Callable[[list[float], list[float], list[float]], float]
    drive: tuple[float, float, float]
    noise: float
    rate: float = 200.0
    seconds: float = 12.0
    start: tuple[float, ...] = ()
    input_factor: float = 1.0


def _text(rig: str) -> str:
    return dedent(rig).lstrip()


def servo() -> Machine:
    """A motor at a voltage turns a load through a gear; the encoder sits on the load."""
    inertia, load, stiffness, loss, bearing, constant, resistance = 6e-4, 2.2e-3, 45.0, 0.012, 0.015, 0.42, 2.6

    def accelerations(u, q, v, at):
        joint = stiffness * (q[0] - q[1]) + loss * (v[0] - v[1]) - at("joint", q[0] - q[1], v[0] - v[1])
        torque = constant * (u - constant * v[0]) / resistance
        return [
            (torque - joint + at("motor", q[0], v[0])) / inertia,
            (joint - bearing * v[1] + at("load", q[1], v[1])) / load,
        ]

    rig = """
        name = "geared servo"

        [system]
        coordinates = { motor = "rad", load = "rad" }
        input = { voltage = "V" }
        kinetic = "motor_inertia*dot(motor)^2/2 + load_inertia*dot(load)^2/2"
        potential = "stiffness*(motor - load)^2/2"
        dissipation = "joint_loss*(dot(motor) - dot(load))^2/2 + bearing_loss*dot(load)^2/2"
        forces = { motor = "torque_constant*(voltage - torque_constant*dot(motor))/resistance" }
        output = "load"
        places = { motor = "motor", load = "load", joint = "motor - load" }

        [system.constants]
        motor_inertia = { value = 6.0, sd = 0.2, unit = "kg cm^2" }
        load_inertia = { guess = 30.0, unit = "kg cm^2" }
        stiffness = { guess = 30.0, unit = "N m / rad" }
        joint_loss = { guess = 0.02, unit = "N m s" }
        bearing_loss = { guess = 0.01, unit = "N m s" }
        torque_constant = { value = 0.42, unit = "N m / A" }
        resistance = { value = 2.6, unit = "ohm" }

        [columns]
        time = { name = "t", unit = "s" }
        input = { name = "u", unit = "V" }
        output = { name = "y", unit = "mrad", noise = 0.3 }
        """
    joints = {"motor": (1.0, 0.0), "load": (0.0, 1.0), "joint": (1.0, -1.0)}
    return Machine(_text(rig), 2, accelerations, joints, lambda q, v, a: 1e3 * q[1], (2.5, 0.3, 5.0), 0.3, rate=250.0)


def two_masses() -> Machine:
    """A torque turns a load through a shaft."""
    inertia, load, stiffness, loss, bearing = 3.2e-3, 9e-3, 7.5, 4e-3, 0.02

    def accelerations(u, q, v, at):
        shaft = stiffness * (q[0] - q[1]) + loss * (v[0] - v[1]) - at("joint", q[0] - q[1], v[0] - v[1])
        return [
            (u - shaft + at("motor", q[0], v[0])) / inertia,
            (shaft - bearing * v[1] + at("load", q[1], v[1])) / load,
        ]

    rig = """
        name = "two-mass drive"

        [system]
        like = "two_mass_drive"

        [system.constants]
        motor_inertia = { value = 3.2e-3, unit = "kg m^2" }
        load_inertia = { guess = 6e-3, unit = "kg m^2" }
        stiffness = { guess = 5.0, unit = "N m" }
        joint_loss = { guess = 2e-3, unit = "N m s" }
        bearing_loss = { guess = 0.01, unit = "N m s" }

        [columns]
        time = { name = "t", unit = "s" }
        input = { name = "u", unit = "N m" }
        output = { name = "y", unit = "mrad", noise = 0.3 }
        """
    joints = {"motor": (1.0, 0.0), "load": (0.0, 1.0), "joint": (1.0, -1.0)}
    return Machine(_text(rig), 2, accelerations, joints, lambda q, v, a: 1e3 * q[1], (0.12, 0.3, 7.0), 0.3)


def cart_pendulum() -> Machine:
    """A force moves a cart on a track, and a pendulum hangs on it."""
    cart, bob, arm, inertia, gravity, track, pivot = 0.8, 0.23, 0.22, 0.0135, 9.81, 1.1, 2.5e-3

    def accelerations(u, q, v, at):
        s, c = sin(q[1]), cos(q[1])
        a, b, d = cart + bob, bob * arm * c, inertia
        push = u + bob * arm * s * v[1] ** 2 - track * v[0] + at("track", q[0], v[0])
        turn = -bob * gravity * arm * s - pivot * v[1] + at("pivot", q[1], v[1])
        free = a * d - b * b
        return [(d * push - b * turn) / free, (a * turn - b * push) / free]

    rig = """
        name = "cart pendulum"

        [system]
        like = "cart_pendulum"

        [system.constants]
        cart = { guess = 0.6, unit = "kg" }
        bob = { value = 0.23, unit = "kg" }
        arm = { guess = 0.25, unit = "m" }
        inertia = { guess = 0.011, unit = "kg m^2" }
        track_loss = { guess = 0.8, unit = "N s / m" }
        pivot_loss = { guess = 2e-3, unit = "N m s" }

        [columns]
        time = { name = "t", unit = "s" }
        input = { name = "u", unit = "N" }
        output = { name = "y", unit = "mrad", noise = 0.5 }
        """
    joints = {"track": (1.0, 0.0), "pivot": (0.0, 1.0)}
    return Machine(_text(rig), 2, accelerations, joints, lambda q, v, a: 1e3 * q[1], (2.0, 0.2, 3.0), 0.5)


def furuta_pendulum() -> Machine:
    """A torque turns an arm in a level plane, and a pendulum hangs at its end."""
    arm, bob, reach, centre, inertia, gravity, axis, pivot = 3.1e-3, 0.07, 0.17, 0.135, 1.9e-3, 9.81, 8e-3, 2.2e-4

    def accelerations(u, q, v, at):
        s, c = sin(q[1]), cos(q[1])
        a, b, d = arm + bob * reach**2 + inertia * s * s, bob * reach * centre * c, inertia
        turn = u - 2 * inertia * s * c * v[0] * v[1] + bob * reach * centre * s * v[1] ** 2 - axis * v[0]
        swing = inertia * s * c * v[0] ** 2 - bob * gravity * centre * s - pivot * v[1]
        turn += at("axis", q[0], v[0])
        swing += at("pivot", q[1], v[1])
        free = a * d - b * b
        return [(d * turn - b * swing) / free, (a * swing - b * turn) / free]

    rig = """
        name = "Furuta pendulum"

        [system]
        like = "furuta_pendulum"

        [system.constants]
        arm_inertia = { guess = 2.5e-3, unit = "kg m^2" }
        bob = { value = 0.07, unit = "kg" }
        reach = { value = 0.17, unit = "m" }
        centre = { guess = 0.12, unit = "m" }
        inertia = { guess = 1.5e-3, unit = "kg m^2" }
        arm_loss = { guess = 5e-3, unit = "N m s" }
        pivot_loss = { guess = 1.5e-4, unit = "N m s" }

        [columns]
        time = { name = "t", unit = "s" }
        input = { name = "u", unit = "N m" }
        output = { name = "y", unit = "mrad", noise = 0.5 }
        """
    joints = {"axis": (1.0, 0.0), "pivot": (0.0, 1.0)}
    return Machine(_text(rig), 2, accelerations, joints, lambda q, v, a: 1e3 * q[1], (0.03, 0.2, 3.0), 0.5)


def quarter_car() -> Machine:
    """A wheel on a measured road carries the body; an accelerometer sits on the body."""
    body, wheel, spring, tyre, damper = 260.0, 31.0, 1.7e4, 1.55e5, 1150.0

    def accelerations(u, q, v, at):
        stroke, rate = q[0] - q[1], v[0] - v[1]
        lift = -spring * stroke - damper * rate + at("suspension", stroke, rate)
        return [lift / body, (-lift - tyre * (q[1] - u)) / wheel]

    rig = """
        name = "quarter car"

        [system]
        like = "quarter_car"

        [system.constants]
        sprung_mass = { value = 260.0, unit = "kg" }
        wheel_mass = { guess = 40.0, unit = "kg" }
        spring = { guess = 2e4, unit = "N / m" }
        tyre = { guess = 2e5, unit = "N / m" }
        damper = { guess = 1500.0, unit = "N s / m" }

        [columns]
        time = { name = "t", unit = "s" }
        input = { name = "u", unit = "mm" }
        output = { name = "y", unit = "m / s^2", noise = 0.02 }
        """
    joints = {"suspension": (1.0, -1.0)}
    return Machine(
        _text(rig),
        2,
        accelerations,
        joints,
        lambda q, v, a: a[0],
        (0.018, 0.4, 9.0),
        0.02,
        rate=250.0,
        input_factor=1e3,
    )


def motor(kind: str = "system") -> Machine:
    """A motor under a torque in steps, which reads its speed, or its position as a drive."""
    inertia, loss = 2.4e-3, 6e-3

    def accelerations(u, q, v, at):
        return [(u - loss * v[0] + at("shaft", q[0], v[0])) / inertia]

    rig = """
        name = "motor under a torque"

        [system]
        coordinates = { phi = "rad" }
        input = { torque = "N m" }
        kinetic = "inertia*dot(phi)^2/2"
        dissipation = "loss*dot(phi)^2/2"
        forces = { phi = "torque" }
        output = "dot(phi)"
        places = { shaft = "phi" }

        [system.constants]
        inertia = { guess = 1e-3, unit = "kg m^2" }
        loss = { guess = 2e-3, unit = "N m s" }

        [columns]
        time = { name = "t", unit = "s" }
        input = { name = "u", unit = "N m", interpolation = "hold" }
        output = { name = "y", unit = "rad / s", noise = 0.02 }
        """
    read = 1
    if kind == "drive":
        read = 0
        rig = """
            name = "motor under a torque"
            kind = "drive"

            [columns]
            time = { name = "t", unit = "s" }
            input = { name = "u", unit = "N m", interpolation = "hold" }
            output = { name = "y", unit = "rad", noise = 0.002 }
            """
    return Machine(
        _text(rig), 1, accelerations, {"shaft": (1.0,)}, lambda q, v, a: (q, v)[read][0], (0.05, 0.0, 0.0),
        0.02 if read else 0.002, seconds=8.0,
    )  # fmt: skip
