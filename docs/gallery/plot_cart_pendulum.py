"""
Pendulum on a driven cart
=========================

A cart moves to and fro, and a pendulum hangs from it. Both motions are recorded. The system is declared in its own
energies: no kind that is built in is needed. The joint of the pendulum rubs, which the declaration does not know.
"""

from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from scipy.integrate import solve_ivp

import discovery

# %%
# The simulated pendulum: 0.2 kg at 0.3 m, and a dry friction of 3 mN m in its joint.
folder = Path(mkdtemp())
mass, length, dry = 0.2, 0.3, 3e-3
time = np.arange(1500) / 100


def record(name, seed):
    """Write a recording."""
    random = np.random.default_rng(seed)
    rates, phases = 2 * np.pi * random.uniform(0.2, 1.2, 5), random.uniform(0, 2 * np.pi, 5)

    def cart(t, derivative=0):
        waves = np.multiply.outer(t, rates) + phases + derivative * np.pi / 2
        return 0.02 * (rates**derivative * np.sin(waves)).sum(axis=-1)

    def motion(t, state):
        angle, rate = state
        torque = -mass * length * (9.81 * np.sin(angle) + cart(t, 2) * np.cos(angle))
        return rate, (torque - 4e-4 * rate - dry * np.tanh(rate / 1e-3)) / (mass * length**2)

    exact = solve_ivp(motion, (0, 15), (0, 0), "LSODA", time, rtol=1e-9, atol=1e-10, max_step=0.01).y[0]
    read = np.degrees(exact) + random.normal(0, 0.05, time.size)
    table = np.column_stack([time, 1e3 * cart(time), read])
    np.savetxt(folder / name, table, delimiter=",", header="t,cart,angle", comments="")


record("fitted.csv", 1)
record("held_out.csv", 2)

# %%
# The declaration: energies and losses in the experimenter's own names.
rig = folder / "rig.toml"
rig.write_text("""
name = "pendulum on a driven cart"
[system]
coordinates = { angle = "rad" }
input = { cart = "m" }
kinetic = "mass*((dot(cart) + rod*cos(angle)*dot(angle))^2 + (rod*sin(angle)*dot(angle))^2)/2"
potential = "-mass*gravity*rod*cos(angle)"
dissipation = "joint_loss*dot(angle)^2/2"
output = "angle"
places = { joint = "angle" }
[system.constants]
mass = { value = 0.2, unit = "kg" }
gravity = { value = 9.81, unit = "m / s^2" }
rod = { guess = 0.25, unit = "m" }
joint_loss = { guess = 1e-3, unit = "N m s" }
[columns]
time = { name = "t", unit = "s" }
input = { name = "cart", unit = "mm" }
output = { name = "angle", unit = "deg", noise = 0.05 }
""")
data = discovery.load_dataset(rig, [folder / "fitted.csv"], [folder / "held_out.csv"])
_ = data.plot_recordings()

# %%
# The friction is named where it is, as a torque.
found = discovery.close_loop(data)
print(found)
print(found.to_pandas())
# sphinx_gallery_thumbnail_number = 2
_ = found.plot_residuals()
