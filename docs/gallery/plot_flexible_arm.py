"""
Flexible arm with a late camera
===============================

A motor turns a rod that bends by forty degrees, and a camera follows its tip. The recordings are those of a simulated
twin: a geometrically exact beam. The camera is 10 ms late, and the rig file does not say so.
"""

from pathlib import Path

import discovery

# %%
# Two manoeuvres are fitted, a third is held out.
folder = Path("..", "..", "datasets", "arm_delay")
train = [folder / "train_paper.csv", folder / "train_large.csv"]
data = discovery.load_dataset(folder / "rig.toml", train, [folder / "holdout_inside.csv"])

# %%
# The declared model is that of a paper: a tip on an arc, with a cubic spring. The loop first finds better mechanics
# of the rod, and then what the instrument does.
found = discovery.close_loop(data)
print(found)
print(f"tau = {1e3 * found.after.values['tau']:.3f} ms")

# %%
_ = found.plot_residuals()
