r"""Prior-data conflict: fitted values that the rig file excludes. What free parameters absorb leaves no residual.

Base compliance hides in alpha, a camera's scale in the length. So the log odds are asked that the rig file's statement
of a quantity is too narrow: the evidence that is gained where its prior is made `WIDE` times as wide,

.. math:: \log \frac{N(v;\, m,\, s^2 + w^2 \sigma^2)}{N(v;\, m,\, s^2 + \sigma^2)},

with m and :math:`\sigma` what is stated, and v and s what the recordings alone say (Evans and Moshonov, Bayesian
Analysis 1 (2006) 893). Tested are

* alpha of an exact arm against :math:`3EI / (m_\mathrm{eff} l^3)` of the rig, see `discovery.theory.prediction`;
* the rod's mass ratio mu and, where it is free, the length against what the rig states;
* the pull of gravity on a pendulum against its length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from discovery.diagnosis.checks import Check, against_length, against_rig, against_stiffness
from discovery.diagnosis.reconciliation import Reconciliation, reconcile
from discovery.equations.lacking import candidates as possible
from discovery.estimation.bench import Bench
from discovery.estimation.fit import Fit, fit_near
from discovery.estimation.problem import Problem
from discovery.foundation.errors import SimulationFailure
from discovery.screening.refits import Refit
from discovery.selection.contender import contenders
from discovery.selection.context import Context

#: A value on quicker mechanics differs by at most this part of what is to be reconciled.
_ALIKE = 0.1


@dataclass(frozen=True)
class Contradiction:
    """A value that contradicts its prediction, and the effects that were tried, if any were sought, to reconcile them.

    Those that reconcile come first, the best or simplest of them at the head.
    """

    check: Check
    tried: tuple[Reconciliation, ...]
    sought: bool = True

    @property
    def reconciling(self) -> tuple[str, ...]:
        """Effects that reconcile; more than one are ambiguous."""
        return tuple(r.effect for r in self.tried if r.reconciles)


@dataclass(frozen=True)
class ContradictionReport:
    """All tests of a fit, and the contradictions among them: none where nothing is predicted or asks for a test."""

    checks: tuple[Check, ...] = ()
    contradictions: tuple[Contradiction, ...] = ()

    @property
    def gross(self) -> tuple[Contradiction, ...]:
        """Stiffnesses that lie far beside the rig, and that no effect reconciles with it."""
        return tuple(c for c in self.contradictions if c.check.gross and not c.reconciling)

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        excluded = [c.check for c in self.contradictions]
        return {
            "checks": [{**asdict(c), "contradicts": c in excluded} for c in self.checks],
            "contradictions": [
                {
                    "parameter": c.check.parameter,
                    "gross": c in self.gross,
                    "reconciling": list(c.reconciling),
                    "tried": [r.summary() for r in c.tried],
                    "sought": c.sought,
                }
                for c in self.contradictions
            ],
        }


def check_contradictions(
    fit: Fit,
    rng: np.random.Generator,
    *,
    candidates: Sequence[str] | None = None,
    bench: Bench | None = None,
    context: Context,
) -> ContradictionReport:
    """Test a fit against the rig, and look for effects that reconcile what contradicts.

    Parameters
    ----------
    fit : Fit
        The final fit of an arm, or of a pendulum whose length the rig states; of any other system nothing is predicted.
        Its bench should hold the candidates, or another kernel is compiled.
    rng : numpy.random.Generator
        Source of the draws of the rig's quantities.
    candidates : sequence of str, optional
        Effects that may reconcile, none to look for none; by default all that could be missing.
    bench : Bench, optional
        Quicker mechanics, on which effects are tried where the fit is no worse on them; by default those of the fit.
    context : Context
        Recordings and settings of the search.
    """
    experiments = fit.problem.bench.experiments
    arm = experiments[0].system.has_rod
    if candidates is None:
        candidates = possible(fit.model, experiments[0].coordinate_unit)
    if not arm:
        checks = against_length(fit)
        excluded = [c for c in checks if c.odds > context.settings.nats]
        pulls = [_gravity(fit, c, candidates, context) for c in excluded]
        return ContradictionReport(checks, tuple(pulls))
    found = [*against_rig(fit), *against_stiffness(fit, rng)]
    contradictions = []
    for check, freed in found:
        if check.odds > context.settings.nats:
            name, target = check.parameter, (check.predicted, check.predicted_sd)
            quick = _quicker(freed, bench, name, target[0], context)
            tried = reconcile(quick, name, target, candidates, context)
            contradictions.append(Contradiction(check, tried, sought=bool(candidates)))
    return ContradictionReport(tuple(c for c, _ in found), tuple(contradictions))


def _quicker(fit: Fit, bench: Bench | None, name: str, target: float, context: Context) -> Fit:
    """Return the fit on other mechanics where it is as likely there and contradicts as much, else as it is."""
    if bench is None:
        return fit
    problem = Problem(fit.model.on_base(bench.base), bench, fit.problem.units, fit.problem.gaussian)
    try:
        found = fit_near(problem, fit.values)
    except SimulationFailure:
        return fit
    if not abs(found.values[name] - fit.values[name]) < _ALIKE * abs(target - fit.values[name]):
        return fit
    added = context.added(fit.model)
    own, quick = (contenders(context, [(added, Refit("", f.problem, f.minimum))])[0].joint for f in (fit, found))
    return found if quick > own - context.settings.nats else fit


def _gravity(fit: Fit, check: Check, candidates: Sequence[str], context: Context) -> Contradiction:
    """Look for effects with which gravity pulls as the rig says; its direction in the frame stays as it was found."""
    share = fit.values["g_c"] / check.value
    target = (share * check.predicted, abs(share) * check.predicted_sd)
    tried = reconcile(fit, "g_c", target, candidates, context)
    return Contradiction(check, tried, sought=bool(candidates))
