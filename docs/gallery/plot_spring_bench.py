"""
Spring bench with dry friction
==============================

A slider runs on a rail between two springs. It is released, and a laser reads its position for four seconds. The
declared model is the linear oscillator of every textbook. What does it lack?
"""

from pathlib import Path

import discovery

# %%
# The folder holds a short rig file and three recordings. Two of them are fitted, the third is held out.
data = discovery.load_dataset(Path("..", "..", "datasets", "spring_bench", "rig.toml"))
_ = data.plot_recordings()

# %%
# The loop refits the declared model, offers every effect of the catalogue, and names one.
found = discovery.close_loop(data)
print(found)
print(found.to_pandas())

# %%
# The simulation had a friction force of 0.06 N on 0.5 kg: 0.12 m/s². Viscous damping takes a share of every swing, dry
# friction a length of it. So no linear model follows the recording to its end. With dry friction, the laser's noise is
# left.
# sphinx_gallery_thumbnail_number = 2
_ = found.plot_residuals()

# %%
# The errors are those of free runs. Of the recording that was held out, only the initial state was fitted.
_ = found.plot_errors()
