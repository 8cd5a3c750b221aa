"""Recordings that share samples: a hold-out that was fitted judges nothing."""

from __future__ import annotations

import numpy as np

from discovery.recording import Recording

__all__ = ["shared_samples"]

#: Noise does not repeat so many readings in a row, of which so many differ.
_ROW, _DIFFERENT = 30, 20


def shared_samples(first: Recording, second: Recording) -> int | None:
    """Return the row of the second recording from which on it repeats readings of the first.

    Parameters
    ----------
    first, second : Recording
        Of one rig.

    Returns
    -------
    int or None
        Counted from 0 among the samples of the second; None where they share nothing that chance would not repeat.
    """
    # To seven digits: a file may have been written again.
    seen, judged = (r.output.astype(np.float32) for r in (first, second))
    if seen.shape[1] != judged.shape[1]:
        return None
    # A run of twice that length holds a whole block of the first wherever it begins.
    whole = [seen[i : i + _ROW] for i in range(0, len(seen) - _ROW + 1, _ROW)]
    blocks = [b for b in whole if np.isfinite(b).all() and len(np.unique(b, axis=0)) >= _DIFFERENT]
    if not blocks:
        return None
    known = {b.tobytes() for b in blocks}
    # Few readings are those with which a block begins.
    begins = np.flatnonzero(np.isin(judged[: 1 - _ROW, 0], [b[0, 0] for b in blocks]))
    return next((int(i) for i in begins if judged[i : i + _ROW].tobytes() in known), None)
