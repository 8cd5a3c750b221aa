"""Minimisations side by side, of which those give up that others have left far behind."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

#: A quick search may be slow at first: it is out only where it leaves so many times the excess of the best one.
SLOW = 100.0
#: Nobody gives up before so many steps,
_WARM = 5
#: or without leaving so many times the excess chi-square of the one ahead,
_BEHIND = 10.0
#: or of what so many noise variances a sample would be.
_LITTLE = 0.1
#: Two starts of the same model that differ by less than this share of their excess, or by this much, have met.
_MET = 1e-3
_ALIKE = 0.1


def is_far_behind(chi2: float, best: float, n_data: int, behind: float = _BEHIND) -> bool:
    """Return whether a fit leaves so much more than the best one, by a factor, that its minimum does not matter."""
    return chi2 - n_data > behind * max(best - n_data, _LITTLE * n_data)


def near_the_best(chi2: Sequence[float], n_data: int, behind: float = _BEHIND) -> list[int]:
    """Return which fits are not far behind the best one, smallest chi-square first."""
    order = sorted(range(len(chi2)), key=lambda i: chi2[i])
    return [i for i in order if not is_far_behind(chi2[i], chi2[order[0]], n_data, behind)]


class Race:
    """Minimisations of which only the best matter, each a model fitted from some start.

    Parameters
    ----------
    n_data : int
        Number of residuals: what noise alone leaves of chi-square.
    behind : float
        Nobody gives up without leaving so many times the excess chi-square of the one ahead.
    """

    def __init__(self, n_data: int, behind: float = _BEHIND) -> None:
        self._n_data, self._behind = n_data, behind
        self._ahead: dict[Hashable, tuple[float, int]] = {}
        self._entrants = 0

    def enter(self, model: Hashable) -> Callable[[float, int], bool]:
        """Return what tells a minimisation, from its cost and its number of steps, whether to give up."""
        me, self._entrants = self._entrants, self._entrants + 1

        def is_behind(cost: float, steps: int) -> bool:
            chi2 = 2 * cost
            ahead, who = self._ahead.get(model, (chi2, me))
            # Of two that are equal the first is followed.
            if chi2 < ahead or who == me:
                self._ahead[model] = chi2, me
            if steps < _WARM:
                return False
            if who != me and 0 <= chi2 - ahead < max(_ALIKE, _MET * (ahead - self._n_data)):
                return True
            return is_far_behind(chi2, min(c for c, _ in self._ahead.values()), self._n_data, self._behind)

        return is_behind
