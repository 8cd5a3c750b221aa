"""
Beam that rings down
====================

A clamped strip of steel is plucked, and a laser reads its tip. The recording begins when the higher modes have died.
The declared model has one mode with constant damping. Air resists large swings more than small ones.
"""

from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

import discovery

# %%
# The simulated beam has 30 lumped masses on bending springs. Each loses a little to the air, with the square of its
# speed. Its motion is solved in its three lowest modes.
size, cells, mass, rigidity = 0.30, 30, 0.040, 0.035  # m, -, kg, N m²
step = size / cells
bend = np.diff(np.eye(cells + 2), 2, axis=0)[:, 2:]  # clamped: the first two nodes stand still
values, shapes = eigh(rigidity / step**3 * bend.T @ bend, mass / cells * np.eye(cells), subset_by_index=(0, 2))
modes = shapes / shapes[-1]
weights = mass / cells * (modes**2).sum(axis=0)
loss = 2e-4 * values  # of the material: it grows with the frequency


def motion(_, state):
    """Return rates and accelerations of the three modes."""
    place, rate = state[:3], state[3:]
    speed = modes @ rate
    air = modes.T @ (0.004 * np.abs(speed) * speed) / weights
    return np.concatenate([rate, -values * place - loss * rate - air])


folder = Path(mkdtemp())
random = np.random.default_rng(1)
time = np.arange(2000) / 100
for name, pluck in {"fitted.csv": 0.06, "held_out.csv": 0.04}.items():
    start = np.array([0.97, 0.03, 0, 0, 0, 0]) * pluck  # a finger bends the strip in nearly its first mode
    exact = solve_ivp(motion, (0, 23), start, "LSODA", time + 3, rtol=1e-9, atol=1e-12).y[:3].sum(axis=0)
    read = 1e3 * exact + random.normal(0, 0.02, time.size)
    np.savetxt(folder / name, np.column_stack([time, read]), delimiter=",", header="t,tip", comments="")

# %%
rig = folder / "rig.toml"
rig.write_text("""
name = "ring-down beam"
kind = "oscillator"
[columns]
time = { name = "t", unit = "s" }
output = { name = "tip", unit = "mm", noise = 0.02 }
""")
data = discovery.load_dataset(rig, [folder / "fitted.csv"], [folder / "held_out.csv"])
_ = data.plot_recordings()

# %%
found = discovery.close_loop(data)
print(found)
print(found.to_pandas())
# sphinx_gallery_thumbnail_number = 2
_ = found.plot_residuals()
