"""Whether a set of effects takes the place of a smaller one: the one rule of the search.

An effect is accepted by its log odds, the smallest of three: the evidence that it gains in training; what it gains
there and held out; and the odds against model error. An error of size a is expected to move the residual by form x a
in any one direction, so an effect that moves it by s has log odds of (s / (form x a))^2 / 2; where none is likelier,
those odds count beside. It must also move more than accepted laws may leave, a share of what they moved. Held out it
must gain half the nats by the estimate, and not lose them over its intervals; it stays until either does.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.selection.contender import Contender
from discovery.selection.decision import Candidacy
from discovery.selection.settings import LoopSettings

HELD = 0.5  #: Part of the nats that is asked held out, and that what was accepted may lose there.


@dataclass(frozen=True)
class Odds:
    """Log odds of a larger set against a smaller one [nats]."""

    train: float  # what the training recordings gain
    held: float  # and the held-out ones
    ahead: float  # these by the estimate alone
    size: float  # movement of the residual over the model error that the larger set leaves
    against_error: float  # log odds against the model error in the direction of the effect
    gain: float  # chi-square removed in training
    beside: bool = False  # whether what the mechanics' own error looks like stood beside both where sizes were judged

    @property
    def total(self) -> float:
        """The log odds that decide."""
        return min(self.train, self.train + self.held, self.against_error)

    @property
    def numbers(self) -> dict[str, float]:
        """All of it, for the record of a decision."""
        return {**asdict(self), "odds": self.total}

    def code(self, settings: LoopSettings, least: float) -> str:
        """Return "accepted", or what is missing; `least` is what the held-out part must gain, over the nats."""
        if not np.isfinite(self.train + self.held):
            return "accepted" if self.train + self.held > 0 else "finite"
        if self.train < settings.nats:
            return "training"
        joint = least > 0 and self.train + self.held < settings.nats
        if joint or self.ahead < least * settings.nats or self.held < min(least, -HELD) * settings.nats:
            return "held_out"
        return "accepted" if self.against_error >= settings.nats else "size"


def odds_of(larger: Contender, smaller: Contender, root: Contender, settings: LoopSettings) -> Odds:
    """Return the log odds of a larger set against a smaller one; `root` is the model without any added effect."""
    with np.errstate(invalid="ignore"):  # of what blows up
        gains = [getattr(larger.evidence, n) - getattr(smaller.evidence, n) for n in ("train", "held", "ahead")]
        sizes = [_sizes((larger, smaller, root), settings, judged=judged) for judged in (False, True)]
        form, nil = _form(larger, smaller, settings), larger.evidence.nil
        size = max(moved / float(np.hypot(error, laws)) for moved, error, laws in sizes)
        against = max(_against(moved, form * error, laws, nil) for moved, error, laws in sizes)
    train, held, ahead = (float(np.nan_to_num(v, nan=-np.inf, posinf=np.inf, neginf=-np.inf)) for v in gains)
    return Odds(train, held, ahead, size, against, float(smaller.chi2 - larger.chi2))


def between_rivals(found: Contender, rival: Contender, settings: LoopSettings) -> float:
    """Return the log odds of a set against one with another effect in its place, where a model error is left.

    That may hide a better fit; what is not fit, as Occam's factor, counts beside.
    """
    odds = odds_of(found, rival, rival, settings)
    joint, held = odds.train + odds.held, rival.evidence.chi2_held - found.evidence.chi2_held
    fit = 0.5 * max(odds.gain, odds.gain + held)
    return min(joint, odds.against_error + max(joint - fit, 0.0))


def _form(larger: Contender, smaller: Contender, settings: LoopSettings) -> float:
    """Return the form error of what a larger set adds."""
    added = [e for e in larger.added if e not in smaller.added]
    if times := max(map(larger.imitation, added), default=0):
        return settings.form_pliable * times
    return settings.form_wide if any(get_effect(e).pliable for e in added) else settings.form_of(larger.model)


def _sizes(sets: tuple[Contender, ...], settings: LoopSettings, *, judged: bool) -> tuple[float, float, float]:
    """Return how far a set moves the residual, the model error that it leaves, and what laws are expected to, all rms.

    `sets`: larger, smaller, root. In training, or in training and held-out recordings together: an effect may show in
    the larger motion of either, or in what is predicted.
    One effect could take all that laws leave: where it moves as much as the share `law`, its odds are the nats.
    """
    parts = [(c.chi2, c.refit.problem.bench.n_data, c.evidence.error) for c in sets]
    if judged:
        held = [(c.evidence.chi2_ahead, c.evidence.count_held, c.evidence.error_held) for c in sets]
        both = zip(parts, held, strict=True)
        parts = [(q + r, n + m, np.sqrt((n * a**2 + m * b**2) / (n + m))) for (q, n, a), (r, m, b) in both]
    (chi2, n_data, error), (without, *_), (bare, *_) = parts
    moved, before = (float(np.sqrt(max(gain, 0.0) / n_data)) for gain in (without - chi2, bare - without))
    laws = settings.law_of(sets[0].model) * before / np.sqrt(2 * settings.nats)
    return moved, float(error), max(float(laws), 1e-12)


def _against(moved: float, error: float, laws: float, nil: float) -> float:
    """Return the log odds against model error; where none is likelier than one, those count beside (`nil` below zero).

    What laws idealise is there in any case.
    """
    return float(min(0.5 * (moved / np.hypot(error, laws)) ** 2 + max(-nil, 0.0), 0.5 * (moved / laws) ** 2))


def candidacy(larger: Contender, smaller: Contender, root: Contender, settings: LoopSettings) -> Candidacy:
    """Return the record of a set against a smaller one."""
    odds = odds_of(larger, smaller, root, settings)
    new = tuple(e for e in larger.added if e not in smaller.added)
    count = len(larger.refit.problem.free)
    return Candidacy(new, odds.train, odds.held, odds.size, larger.evidence.error, larger.chi2, count)
