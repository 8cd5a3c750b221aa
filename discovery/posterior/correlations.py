"""Correlations of a posterior's draws: of its parameters, with what these share physically, and along its chains.

Recordings fix combinations: the frequency is stiffness over inertia, a decay the loss of a cycle. Which combination two
parameters share follows from the kinds of the effects that they belong to, not from their names.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import Effect, Expressed
from discovery.declarations.registry import effect_name
from discovery.equations.model import Model
from discovery.foundation.arrays import FloatArray
from discovery.foundation.start_names import is_start

if TYPE_CHECKING:
    from discovery.posterior.draws import Posterior

#: Correlations of at least this size are told.
NOTABLE = 0.3
#: Lags reach so many autocorrelation times, and are at most so many.
_REACH, _MOST = 6.0, 60
#: What an effect of each kind does to the motion or to its reading.
_ROLES = {
    "kinetic": "inertia",
    "potential": "spring",
    "dissipation": "loss",
    "load": "force",
    "closure": "path",
    "memory": "memory",
    "mode": "memory",
    "joint": "memory",
    "drive": "drive",
    "sensor": "reading",
    "shape": "rod",
}
#: What a parameter of the mechanics itself does, by its unit.
_OF_BASE = {"s^-2 q": "drive", "s^2 q^-1": "inertia", "s": "loss"}
_MEANINGS = {
    ("spring", "spring"): "both push back in nearly the same way, so that mostly their sum is seen",
    ("loss", "loss"): "both take energy out of the swing: the decay fixes the loss of a cycle, which they share, and "
    "only its change with amplitude and speed tells them apart",
    ("loss", "memory"): "an inner state loses energy too: they share the loss of a cycle",
    ("memory", "spring"): "an inner state that has not yet relaxed pushes back like a spring: their sum is seen",
    ("loss", "spring"): "one sets the frequency and the other the decay; over many swings these are independent, over "
    "few swings or under a steady force both are in the phase",
    ("inertia", "spring"): "the frequency fixes only stiffness over inertia",
    ("inertia", "loss"): "the decay fixes only loss over inertia",
    ("inertia", "inertia"): "both are moving mass, so that mostly their sum is seen",
    ("drive", "spring"): "the response to a slow input is drive over stiffness: mostly their ratio is seen",
    ("drive", "loss"): "the response near resonance is drive over loss: mostly their ratio is seen",
    ("drive", "inertia"): "the response to a fast input is drive over inertia: mostly their ratio is seen",
    ("drive", "drive"): "both change what the system receives",
    ("drive", "reading"): "the input and the reading refer to the same frame: what one adds, the other can take off",
    ("path", "path"): "both shape the path of the tip, one at small and the other at large deflection",
    ("path", "reading"): "both move where the instrument sees the tip at a given deflection",
    ("path", "spring"): "both grow with the deflection: the tip's path and its force are seen in the same readings",
    ("reading", "reading"): "both change what the instrument says of the same motion",
    ("rod", "spring"): "a bent or yielding rod rests and swings as if its spring were another",
    ("inertia", "memory"): "an inner state shifts the frequency, as inertia does",
    ("memory", "memory"): "both are inner states that store and lose energy",
}
_READ = "what the instrument adds to a reading resembles a change of the motion itself"
_PUSHED = "a force that acts at the pace of the motion resembles a change of the motion's own forces"
_OTHERWISE = "these recordings fix a combination of both better than each alone"


@dataclass(frozen=True)
class Correlations:
    """Correlation coefficients `matrix` (d, d) of the draws of the physical parameters and of the noise, by `names`.

    `meanings` says what two parameters share, of pairs whose correlation is at least `NOTABLE`, the strongest first.
    """

    names: tuple[str, ...]
    matrix: FloatArray
    meanings: dict[tuple[str, str], str]

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        at = {name: i for i, name in enumerate(self.names)}
        return {
            "names": list(self.names),
            "matrix": self.matrix.tolist(),
            "pairs": [
                {"pair": [a, b], "correlation": float(self.matrix[at[a], at[b]]), "meaning": meaning}
                for (a, b), meaning in self.meanings.items()
            ],
        }


def quantities(posterior: Posterior) -> tuple[str, ...]:
    """Return the names of the sampled quantities but for the initial states."""
    return tuple(n for n in posterior.names if not is_start(n))


def correlations(posterior: Posterior) -> Correlations:
    """Return the correlations of a posterior; initial states are left out."""
    names = quantities(posterior)
    flat = posterior.flat()
    matrix = np.atleast_2d(np.corrcoef(np.array([flat[n] for n in names])))
    size = {(names[i], names[j]): abs(matrix[i, j]) for i, j in combinations(range(len(names)), 2)}
    told = sorted((pair for pair, r in size.items() if r >= NOTABLE), key=lambda pair: -size[pair])
    return Correlations(names, matrix, {pair: _meaning(posterior, *pair) for pair in told})


def _meaning(posterior: Posterior, first: str, second: str) -> str:
    physical = posterior.model.parameters
    if first in physical and second in physical:
        return shared(posterior.model, first, second)
    if first not in physical and second not in physical:
        return "both describe the noise"
    return "the size of the noise should not depend on the motion: a sign that what is left is no noise"


@dataclass(frozen=True)
class Autocorrelation:
    """Autocorrelation functions of the physical parameters and of the noise, at `lags` (k,) [steps].

    `functions`, by name, are means over the walkers of each ensemble (ensembles, k), 1 at lag 0; `tau` are their
    integrated autocorrelation times [steps].
    """

    lags: FloatArray
    functions: dict[str, FloatArray]
    tau: dict[str, float]

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        functions = {name: np.round(f, 4).tolist() for name, f in self.functions.items()}
        return {"lags": self.lags.tolist(), "functions": functions, "tau": dict(self.tau)}


def autocorrelation(posterior: Posterior) -> Autocorrelation:
    """Return the autocorrelation of a posterior's draws; initial states are left out."""
    thin = int(posterior.provenance.get("thin", 1))
    names = quantities(posterior)
    tau = {n: float(posterior.tau[n]) for n in names}
    longest = posterior.draws.shape[1]
    wanted = int(np.ceil(_REACH * max(tau.values()) / thin))
    count = max(2, min(wanted + 1, longest // 2, _MOST))
    functions = {n: _function(posterior.draws[..., posterior.names.index(n)], count) for n in names}
    return Autocorrelation(thin * np.arange(count, dtype=float), functions, tau)


def _function(x: FloatArray, count: int) -> FloatArray:
    """Return the first values of the autocorrelation function of chains (e, n, w), shape (e, count)."""
    # The mean of the whole ensemble, not of each walker, whose few draws would hide slow changes.
    centred = x - x.mean(axis=(1, 2), keepdims=True)
    n = x.shape[1]
    lagged = [(centred[:, : n - k] * centred[:, k:]).mean(axis=(1, 2)) for k in range(count)]
    return np.stack(lagged, axis=1) / lagged[0][:, None]


def shared(model: Model, first: str, second: str) -> str:
    """Return what two parameters of a model share, as a clause."""
    owners = _owner(model, first), _owner(model, second)
    if owners[0] is owners[1]:
        title = "the mechanics" if owners[0] is None else effect_name(owners[0].id())
        return f"both belong to {title}, whose size and form are seen together"
    roles = _role(model, owners[0], first), _role(model, owners[1], second)
    a, b = sorted(roles)
    if a == b == "spring" and (order := _by_degree({first: owners[0], second: owners[1]})):
        small, large = order
        return (
            f"{small} is the stiffness at small deflection and {large} what large deflection adds: the force is fixed "
            "best in between, where more of one makes up for less of the other"
        )
    if (a, b) in _MEANINGS:
        return _MEANINGS[a, b]
    return _READ if "reading" in roles else _PUSHED if "force" in roles else _OTHERWISE


def _owner(model: Model, name: str) -> Effect | None:
    """Return the effect that declares a parameter; None for the mechanics."""
    return next((e for e in model.terms if name in {p.name for p in e.parameters()}), None)


def _role(model: Model, owner: Effect | None, name: str) -> str:
    if owner is not None:
        return _ROLES.get(owner.kind, "")
    # A number without a unit: the mass of an arm's rod, else how much of the input arrives.
    return _OF_BASE.get(model.parameters[name].unit, "inertia" if model.mechanics.system.has_rod else "drive")


def _by_degree(owners: dict[str, Effect | None]) -> list[str]:
    """Return parameters with the lower degree of their energies first; empty where none is lower."""
    degrees = {name: degree for name, owner in owners.items() if (degree := _degree(owner)) is not None}
    return sorted(degrees, key=degrees.__getitem__) if len(set(degrees.values())) == 2 else []


def _degree(effect: Effect | None) -> int | None:
    """Return the degree of a potential energy in the deflection; None where it is no polynomial in it."""
    if not isinstance(effect, Expressed):
        return None
    energy = sp.sympify(effect.expression()).subs({s.U: s.delta**2 / 2, s.U_4: s.delta**4 / 4})
    if not energy.is_polynomial(s.delta) or not energy.has(s.delta):
        return None
    return int(sp.degree(energy, s.delta))
