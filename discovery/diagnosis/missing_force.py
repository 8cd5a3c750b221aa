"""What is left when the catalogue fails: the missing force in time, what it depends on, and a patch.

None of it is an explanation: a patch lowers the error of predictions and says nothing of where the force comes from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from discovery.declarations.units import in_coordinate
from discovery.diagnosis.force_dependence import ForceDependence, Sites, dependences, depends_on
from discovery.diagnosis.force_law import Judge, Patch, sparse_law, spline_law, tried
from discovery.diagnosis.latent_force import LatentForce, reconstruct
from discovery.estimation.fit import Fit
from discovery.foundation.errors import ComputationError
from discovery.recordings.experiment import Experiment

#: Twice the logarithm of the likelihood ratio from which there is a force at all, as for an effect of the catalogue.
LEAST_GAIN = 40.0
#: Sets of variables, of those that cannot be told apart, whose laws are tried.
_MOST_SETS = 2


@dataclass(frozen=True)
class MissingForce:
    """What is left unexplained: as a force in time by fitted recording, what it depends on, and patches.

    `dependence` has the best first and is empty where there is no force; `depends` has the simplest sets that predict
    nearly as much, of which more than one cannot be told apart here. Of the patches tried, the best on the held-out
    recordings is first. The force is per unit inertia, the coordinate in an SI unit.
    """

    forces: tuple[LatentForce, ...]
    dependence: tuple[ForceDependence, ...]
    depends: tuple[ForceDependence, ...]
    patches: tuple[Patch, ...]
    coordinate: str = "rad"

    @property
    def patch(self) -> Patch | None:
        """The patch that is offered."""
        return next((p for p in self.patches if p.accepted), None)

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        return {
            "unit": in_coordinate("q s^-2", self.coordinate),
            "recordings": [f.summary() for f in self.forces],
            "dependence": [asdict(d) for d in self.dependence],
            "depends_on": [list(d.variables) for d in self.depends],
            "patches": [asdict(p) for p in self.patches],
            "result": "patch" if self.patch else "no patch",
            "held_parameters": list(self.forces[0].equivalent),
        }


def missing_force(fit: Fit, holdout: Sequence[Experiment] = ()) -> MissingForce:
    """Return what a fitted model leaves unexplained as a force, what the force depends on, and patches for it.

    The parameters are held while the force is reconstructed. Patches are tried on the held-out recordings, or on the
    parts of the training recordings that were not fitted if there are none.

    Raises ComputationError if no motion beside a fitted run is found.
    """
    period = 2 * np.pi * fit.problem.units.time
    coordinate = fit.problem.bench.experiments[0].coordinate_unit
    try:
        forces = tuple(reconstruct(fit, i) for i in range(len(fit.problem.bench.experiments)))
    except ComputationError as failure:
        why = f"{str(failure)[:1].lower()}{str(failure)[1:]}"
        raise ComputationError(
            f"The missing force could not be reconstructed: {why} The answer does not depend on it; shorter "
            "recordings, with samples = [start, stop], may have one."
        ) from failure
    if max(f.gain for f in forces) < LEAST_GAIN:
        return MissingForce(forces, (), (), (), coordinate)
    sites = Sites.of(forces, period)
    found = dependences(sites)
    depends = depends_on(found)
    known = [d for d in depends if "time" not in d.variables]
    patches: list[Patch] = []
    if known:
        judge = Judge(fit, holdout)
        laws = [law(sites, d, fit.problem.free) for d in known[:_MOST_SETS] for law in (sparse_law, spline_law)]
        patches = [tried(law, fit, judge) for law in laws]
        patches.sort(key=lambda p: np.inf if p.after is None else p.after)
    return MissingForce(forces, found, depends, tuple(patches), coordinate)
