"""Which kind of case has which number: every 25 in a row hold the same shares, in an order that the seed draws."""

from __future__ import annotations

import numpy as np

#: Of 25 cases, so many of each kind (12 % clean, 12 % outsiders), and of each system.
KINDS = {"none": 3, "outside": 3, "single": 19}
SYSTEMS = {"arm": 9, "oscillator": 4, "decay": 3, "pendulum": 4, "bench": 2, "drive": 2, "servo": 1}


def kind_and_system(seed: int, index: int) -> tuple[str, str]:
    """Return what case a number is."""
    block, place = divmod(index, 25)
    rng = np.random.default_rng([seed, block, 25])
    found = []
    for shares in (KINDS, SYSTEMS):
        listed = [name for name, count in shares.items() for _ in range(count)]
        found.append(listed[int(rng.permutation(25)[place])])
    return found[0], found[1]
