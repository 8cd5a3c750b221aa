"""
Pendulum with drag
==================

A ball of foam on a rod swings in air and is filmed. The declared model has gravity and viscous damping. A large ball
meets air that resists with the square of its speed.
"""

from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from scipy.integrate import solve_ivp

import discovery

# %%
# The recordings: a release at 60 and one at 30 degrees to fit, one at 45 degrees to judge.
folder = Path(mkdtemp())
random = np.random.default_rng(1)
length, mass, width = 0.80, 0.060, 0.12  # m, kg, m
drag = 0.5 * 1.2 * 0.47 * np.pi / 4 * width**2 * length / mass  # of a sphere in air


def motion(_, state):
    """Return rate and acceleration of the angle."""
    angle, rate = state
    return rate, -9.81 / length * np.sin(angle) - 0.02 * rate - drag * abs(rate) * rate


time = np.arange(600) / 30
for release in (60, 45, 30):
    exact = solve_ivp(motion, (0, 20), (np.radians(release), 0), t_eval=time, rtol=1e-9, atol=1e-9).y[0]
    seen = np.degrees(exact) + random.normal(0, 0.2, time.size)
    np.savetxt(folder / f"{release}.csv", np.column_stack([time, seen]), delimiter=",", header="t,angle", comments="")

# %%
# The rig file says what is known before anyone looks at the recordings.
rig = folder / "rig.toml"
rig.write_text("""
name = "foam ball on a rod"
kind = "pendulum"
length_m = { value = 0.80, sd = 0.005 }
[columns]
time = { name = "t", unit = "s" }
output = { name = "angle", unit = "deg", noise = 0.2 }
""")
data = discovery.load_dataset(rig, [folder / "60.csv", folder / "30.csv"], [folder / "45.csv"])

# %%
# Drag is named, with the coefficient that the formula of a sphere gives.
found = discovery.close_loop(data)
print(found)
print(f"simulated: c_2 = {drag:.4f}")
_ = found.plot_residuals()
