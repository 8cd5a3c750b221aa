"""
Electronic circuit
==================

An oscillator need not move. A circuit of coil, capacitor and resistor obeys the equation of a mass on a spring. Its
capacitor is not quite linear: its voltage grows faster than its charge. The declared model is the linear oscillator.
"""

from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from scipy.integrate import solve_ivp

import discovery

# %%
# The simulated circuit: resonance at 60 Hz, and a voltage with a cubic part. A random voltage drives it.
folder = Path(mkdtemp())
time = np.arange(3000) / 1000


def record(name, seed):
    """Write a recording."""
    random = np.random.default_rng(seed)
    rates, phases = random.uniform(5, 120, 20), random.uniform(0, 2 * np.pi, 20)

    def driving(t):
        return 0.02 * np.sin(2 * np.pi * np.multiply.outer(t, rates) + phases).sum(axis=-1)

    def circuit(t, state):
        volts, slope = state
        stiffness = (2 * np.pi * 60) ** 2
        return slope, stiffness * (driving(t) - volts - 1.5 * volts**3) - 30.0 * slope

    exact = solve_ivp(circuit, (0, 3), (0, 0), t_eval=time, rtol=1e-9, atol=1e-11, max_step=1e-3).y[0]
    read = 1e3 * exact + random.normal(0, 0.2, time.size)
    table = np.column_stack([time, 1e3 * driving(time), read])
    np.savetxt(folder / name, table, delimiter=",", header="t,V1,V2", comments="")


record("fitted.csv", 1)
record("held_out.csv", 2)

# %%
# The voltage between two samples of the input is known: it was a sum of sines below half the sample rate.
rig = folder / "rig.toml"
rig.write_text("""
name = "circuit"
kind = "oscillator"
[columns]
time = { name = "t", unit = "s" }
input = { name = "V1", unit = "mV", interpolation = "band_limited" }
output = { name = "V2", unit = "mV", noise = 0.2 }
""")
data = discovery.load_dataset(rig, [folder / "fitted.csv"], [folder / "held_out.csv"])

# %%
# The stiffness grows with the square of the voltage, by 1.5 per V².
found = discovery.close_loop(data)
print(found)
ratio = found.after.values["beta"] / found.after.values["alpha"]
print(f"beta / alpha = {ratio:.3f} V^-2, simulated 1.5")
_ = found.plot_residuals()
