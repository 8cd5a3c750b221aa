"""Checkpoints of a run: everything that the next step of its ensembles depends on, in one HDF5 file.

A run that was interrupted, at whatever moment, continues from its last checkpoint to the very same chain.
"""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import emcee
import h5py
import numpy as np

from discovery.estimation.proposal import Proposal
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.io import atomic_write
from discovery.posterior.ensembles import Ensemble

_PROPOSAL = ("centre", "factor")
#: Points that are asked for together, in whole lanes of the kernel, and seconds after which what was done is kept.
_BLOCK, _KEPT_AFTER = 512, 2.0


def fingerprint(*parts: bytes | str) -> str:
    """Return a hash of everything that determines a run."""
    digest = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        digest.update(len(data).to_bytes(8, "little") + data)
    return digest.hexdigest()


def save(
    path: str | os.PathLike[str], ensembles: Sequence[Ensemble], run: str, asked: FloatArray | None = None
) -> None:
    """Write a checkpoint (HDF5) of the run of a fingerprint, beside its place first: there is never half a file.

    `asked` (n, 2) are the log densities that the run asked for beside its ensembles, see `Remembered`.
    """
    # In memory: on a full disk the library of the format ends the process.
    made = BytesIO()
    with h5py.File(made, "w") as file:
        file.attrs["run"] = run
        file["densities"] = np.empty((0, 2)) if asked is None else asked
        for i, ensemble in enumerate(ensembles):
            group = file.create_group(f"ensemble_{i}")
            name, key, position, has_gauss, gauss = ensemble.state.random_state
            group.attrs.update({"random_name": name, "position": position, "has_gauss": has_gauss, "gauss": gauss})
            group.attrs.update({"adapted": ensemble.adapted, "informed": ensemble.informed})
            arrays = {"chain": ensemble.chain, "log_prob": ensemble.log_prob, "random_key": key}
            arrays |= {name: getattr(ensemble.independence.proposal, name) for name in _PROPOSAL}
            for dataset, data in arrays.items():
                group.create_dataset(dataset, data=data)
            for move, counted in ensemble.moves.items():
                group.attrs[f"accepted_{move}"] = (counted.accepted, counted.proposed)
    with atomic_write(path) as temporary:
        temporary.write_bytes(made.getbuffer())


def restore(path: str | os.PathLike[str], ensembles: Sequence[Ensemble], run: str) -> FloatArray | None:
    """Bring ensembles to where a checkpoint of their run left them; None where there is none.

    Returned: the log densities (n, 2) that the run asked for beside its ensembles. InputError if the file is not a
    checkpoint of this run.
    """
    path = Path(path)
    if not path.exists():
        return None
    cure = "Delete it, or name another file."
    try:
        with h5py.File(path) as file:
            if file.attrs["run"] != run:
                raise InputError(f"{path} holds the chains of another model, recording or seed. {cure}")
            for i, ensemble in enumerate(ensembles):
                _restore(ensemble, file[f"ensemble_{i}"])
            return np.asarray(file["densities"][:], np.float64)
    except (OSError, KeyError) as error:
        raise InputError(f"{path} is not a checkpoint of a posterior. {cure}") from error


def _restore(ensemble: Ensemble, group: Any) -> None:
    attributes = group.attrs
    ensemble.chain, ensemble.log_prob = group["chain"][:], group["log_prob"][:]
    ensemble.independence.proposal = Proposal(*(group[name][:] for name in _PROPOSAL))
    ensemble.adapted, ensemble.informed = int(attributes["adapted"]), bool(attributes["informed"])
    random = (
        str(attributes["random_name"]),
        group["random_key"][:],
        int(attributes["position"]),
        int(attributes["has_gauss"]),
        float(attributes["gauss"]),
    )
    ensemble.state = emcee.State(ensemble.chain[-1], log_prob=ensemble.log_prob[-1], random_state=random)
    for move, counted in ensemble.moves.items():
        counted.accepted, counted.proposed = (int(n) for n in attributes[f"accepted_{move}"])


class Remembered:
    """A log density of points (k, d) that are asked for in an order that only a seed decides; `keep` keeps `values`."""

    def __init__(self, log_density: Callable[[FloatArray], FloatArray], keep: Callable[[], None]) -> None:
        #: First coordinate and log density of every point so far, or those of an earlier run, shape (n, 2).
        self.values = np.empty((0, 2))
        self._log_density, self._keep = log_density, keep
        self._asked, self._kept = 0, time.perf_counter()

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return the log density at points (k, d)."""
        found = np.empty(len(points))
        for first in range(0, len(points), _BLOCK):
            part = slice(first, first + _BLOCK)
            found[part] = self._of_block(points[part])
        return found

    def _of_block(self, points: FloatArray) -> FloatArray:
        own = slice(self._asked, self._asked + len(points))
        self._asked = own.stop
        if not np.array_equal(self.values[own, 0], points[:, 0]):
            # Nothing is known from here on, or the earlier run was asked for other numbers of draws.
            values = np.column_stack([points[:, 0], self._log_density(points)])
            self.values = np.concatenate([self.values[: own.start], values])
            if time.perf_counter() - self._kept > _KEPT_AFTER:
                self._keep()
                self._kept = time.perf_counter()
        return self.values[own, 1]
