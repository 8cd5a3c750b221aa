"""One set of effects in the search, fitted and judged."""

from __future__ import annotations

from dataclasses import dataclass, replace

from discovery.case import Case
from discovery.refits import Refit
from discovery.simplicity import imitates, simplicity

__all__ = ["Node", "merit"]


@dataclass(frozen=True, eq=False)
class Node:
    """A set of effects beside the declared ones.

    Parameters
    ----------
    added : tuple of str
        Effects in the order in which they were added.
    refit : Refit
        The model with them, what the rig knows free within its uncertainty.
    rough, held_rough : float
        Systematic part of the training and of the held-out residual [noise sds].
    held : float
        Chi-square of the held-out recordings.
    """

    added: tuple[str, ...]
    refit: Refit
    rough: float
    held: float
    held_rough: float

    @classmethod
    def of(cls, added: tuple[str, ...], refit: Refit, case: Case) -> Node:
        """Judge a refitted model."""
        on_train = refit.predict()
        bench = refit.problem.bench
        held = case.judge.predictions(bench, [(refit.problem.model, refit.values, on_train)])[0]
        chi2, _, held_rough = case.judge.score(held)
        return cls(added, refit, case.roughness(on_train), chi2, held_rough)

    def with_last(self, effect: str) -> Node:
        """Return the same set with one effect named last."""
        return replace(self, added=(*(e for e in self.added if e != effect), effect))

    @property
    def chi2(self) -> float:
        """Sum of squared normalised residuals, with those of what the rig knows."""
        return self.refit.chi2

    def priced(self, price: float) -> float:
        """Return chi-square with a price for every free parameter."""
        return self.refit.priced(price)


def merit(node: Node, least: float, price: float) -> tuple:
    """Return a key that sorts sets of equal merit: plain laws, few parameters, smaller error, then simpler effects.

    `least` is the smallest chi-square over all recordings among them; less than a price above it is no difference.
    """
    system = node.refit.problem.model.mechanics.system
    plain = sum(map(imitates, node.added))
    error = max(node.chi2 + node.held, least + price)
    return plain, len(node.refit.problem.free), error, [simplicity(e, system) for e in node.added]
