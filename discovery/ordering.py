"""Which of several sets of effects is tried first, and which is better than another."""

from __future__ import annotations

from collections.abc import Sequence

from discovery.branch import Child
from discovery.case import Case
from discovery.node import Node, merit
from discovery.refits import Refit
from discovery.simplicity import imitates

__all__ = ["better", "helps", "ordered"]

#: So many sets that are equally good are judged on held-out data.
_TRIED = 4


def helps(case: Case, best: Node, refit: Refit) -> bool:
    """Return whether a refit removes a share of the excess worth naming of what the best set leaves."""
    return best.chi2 - refit.chi2 > case.settings.least_share * case.excess(best.chi2)


def ordered(case: Case, best: Node, children: Sequence[Child]) -> list[Node]:
    """Return the sets that are as good as the best of them, simplest first.

    Parameters
    ----------
    case : Case
        Recordings and thresholds.
    best : Node
        The set found so far.
    children : sequence of Child
        What may take its place, smallest chi-square first.
    """
    if not children:
        return []
    price = case.settings.price
    first = min((r for _, r in children), key=lambda r: r.priced(price))
    margin = case.margin(first.chi2, best.chi2 - first.chi2, pliable=imitates(first.effect))
    limit = first.priced(price) + margin
    tied = [(added, r) for added, r in children if r.priced(price) <= limit][:_TRIED]
    nodes = [Node.of(added, r, case) for added, r in tied]
    if min(n.rough for n in nodes) > case.settings.ceiling:
        # None of them explains what is there: then what was not fitted knows best.
        seen = [id(r) for _, r in tied]
        others = [(added, r) for added, r in children[:_TRIED] if id(r) not in seen and helps(case, best, r)]
        nodes = _by_both(case, best, [*nodes, *(Node.of(added, r, case) for added, r in others)])
    else:
        least = min(n.chi2 + n.held for n in nodes)
        nodes.sort(key=lambda n: merit(n, least, price))
    if all(imitates(n.refit.effect) for n in nodes):
        # What a pliable law imitates deserves a try of its own, if it explains nearly all.
        enough = best.chi2 - case.settings.pair_share * case.excess(best.chi2)
        plain = [(added, r) for added, r in children if not imitates(r.effect) and r.chi2 < enough][:1]
        nodes += [Node.of(added, r, case) for added, r in plain]
    return nodes


def _by_both(case: Case, best: Node, nodes: Sequence[Node]) -> list[Node]:
    """Sort sets by what they leave of all recordings, those that are equal within a tie by their merit."""
    settings = case.settings
    least = min(n.chi2 + n.held for n in nodes)
    margin = max(settings.price, settings.tie * (case.excess(least) - case.n_held))
    # Laws that differ in what they idealise only are equals.
    alike = max(settings.price, settings.form * (best.chi2 + best.held - least))
    equal = [n for n in nodes if n.chi2 + n.held <= least + margin]
    rest = [n for n in nodes if n not in equal]
    return sorted(equal, key=lambda n: merit(n, least, alike)) + sorted(rest, key=lambda n: n.chi2 + n.held)


def better(case: Case, best: Node, node: Node) -> str:
    """Say why a set with another effect in the place of a member is better than the best one; "" if it is not."""
    price = case.settings.price
    gain = best.priced(price) - node.priced(price)
    if gain > case.margin(best.chi2) and node.held < best.held:
        return f"in its place {node.added[-1]} lowers chi-square by {gain:.0f} more"
    (plain, count, *_), (plain_best, count_best, *_) = (merit(n, 0.0, price) for n in (node, best))
    simpler = plain <= plain_best and count <= count_best and (plain, count) != (plain_best, count_best)
    if simpler and node.chi2 <= best.chi2 + price and node.held <= best.held + price:
        return f"in its place {node.added[-1]} leaves no more and is simpler"
    return ""
