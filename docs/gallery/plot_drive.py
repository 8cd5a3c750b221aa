"""
Drive with dry friction
=======================

A motor pushes a carriage. Its force and the carriage's position are recorded. The declared model knows inertia and
viscous friction. The guide also has dry friction of constant size.
"""

from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from scipy.integrate import solve_ivp

import discovery

# %%
# The simulated carriage: 2 kg, 8 N s/m, 1.5 N of dry friction. The force is a sum of sines.
folder = Path(mkdtemp())
time = np.arange(1000) / 100


def record(name, seed):
    """Write a recording."""
    random = np.random.default_rng(seed)
    rates, phases = random.uniform(0.2, 2.5, 6), random.uniform(0, 2 * np.pi, 6)

    def force(t):
        return 4.0 * np.sin(2 * np.pi * np.multiply.outer(t, rates) + phases).sum(axis=-1) * np.minimum(1, t)

    def motion(t, state):
        return state[1], (force(t) - 8.0 * state[1] - 1.5 * np.tanh(state[1] / 1e-3)) / 2.0

    exact = solve_ivp(motion, (0, 10), (0, 0), "LSODA", time, rtol=1e-9, atol=1e-11, max_step=0.01).y[0]
    read = 1e3 * exact + random.normal(0, 0.05, time.size)
    table = np.column_stack([time, force(time), read])
    np.savetxt(folder / name, table, delimiter=",", header="t,force,x", comments="")


record("fitted.csv", 1)
record("held_out.csv", 2)

# %%
rig = folder / "rig.toml"
rig.write_text("""
name = "carriage"
kind = "drive"
[columns]
time = { name = "t", unit = "s" }
input = { name = "force", unit = "N", interpolation = "spline" }
output = { name = "x", unit = "mm", noise = 0.05 }
""")
data = discovery.load_dataset(rig, [folder / "fitted.csv"], [folder / "held_out.csv"])
_ = data.plot_recordings()

# %%
# Motion tells ratios to the inertia: f_c is a force over the mass, 1.5 N / 2 kg.
found = discovery.close_loop(data)
print(found)
print("simulated: f_c = 0.75 m s^-2")
_ = found.plot_errors()
