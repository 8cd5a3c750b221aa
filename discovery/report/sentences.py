"""The sentences that say what a search decided, made from the records of loop.json and from nothing else.

The console, the page, the table of a campaign and the comparison of runs all say the same. No program reads a sentence.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from discovery.declarations.registry import effect_name
from discovery.estimation.importance import LARGEST_K
from discovery.report.doubt_sentences import budget_sentence, failure_sentence
from discovery.report.model_error_words import as_none, depends_words, held_words, share_words
from discovery.report.numbers import Record, listed, plain, sizes

#: What became of a candidate, in two or three words, by the code of the decision.
OUTCOMES = {
    "accepted": "added",
    "training": "too little in training",
    "held_out": "too little held out",
    "chance": "no more than chance",
    "size": "within model error",
    "finite": "blows up",
}
#: Odds beyond which a number would promise more than a model of the noise can keep.
_MOST = 10_000


def chances(log_odds: float | None) -> str:
    """Return log odds [nats] as odds that a reader can weigh.

    Examples
    --------
    >>> chances(3.0), chances(700.0), chances(-3.0)
    ('odds of 20 to 1', 'odds of more than 10 000 to 1', 'odds of 1 to 20')
    """
    if log_odds is None or math.isnan(log_odds):
        return "odds that cannot be told"
    if abs(log_odds) >= math.log(_MOST):
        return "odds of more than 10 000 to 1" if log_odds > 0 else "odds of less than 1 to 10 000"
    odds = f"{float(f'{math.exp(abs(log_odds)):.1e}'):g}"
    if odds == "1":
        return "even odds"
    return f"odds of {odds} to 1" if log_odds > 0 else f"odds of 1 to {odds}"


def probability_words(probability: float | None) -> str:
    """Return a probability with the digits that mean something.

    Examples
    --------
    >>> probability_words(0.8765), probability_words(0.99968), probability_words(1 - 1e-11)
    ('0.88', '0.9997', 'more than 0.9999')
    """
    if probability is None or math.isnan(probability):
        return "unknown"
    rest = min(probability, 1 - probability)
    if rest < 1 / _MOST:
        return "more than 0.9999" if probability > 0.5 else "less than 0.0001"
    return f"{probability:.{max(2, -math.floor(math.log10(rest)))}f}"


def inclusion_words(effect: Record) -> str:
    """Return the probability of an added effect, and that of its group where others explain as much."""
    words = f"probability {probability_words(effect['probability'])}"
    if effect["ambiguous_with"]:
        words += f", of the group {probability_words(effect['group_probability'])}"
    return words


def verdict_sentence(loop: Record) -> str:
    """Return why the verdict is what it is: the model error that is left, and what it depends on."""
    if loop.get("failure"):
        return failure_sentence(loop["failure"])
    error = loop["model_error"]
    (before, after, _), unit = sizes([error[k] for k in ("before", "after", "least")], error["unit"])
    if loop["verdict"] == "nothing_missing":
        return f"the declared model keeps a model error of {after} {unit}, which {as_none(error)}"
    if loop["verdict"] == "explained":
        moves = "falls" if (error["after"] or 0.0) < (error["before"] or math.inf) else "goes"
        return f"the model error {moves} from {before} to {after} {unit}, which {as_none(error)}"
    if any(step["code"] == "impossible" for step in loop.get("steps", ())):
        return f"{_REASONS['impossible']({})}, so nothing was searched"
    part = f", {share_words(error)} of that before" if loop["effects"] and share_words(error) else ""
    part += held_words(error)
    if loop["verdict"] == "partly_explained":
        return f"what is left is a model error of {after} {unit}{part}{depends_words(error)}"
    rest = f"and no effect is likely enough to be named{depends_words(error)}"
    return f"a model error of {after} {unit} is left{part}, {rest}"


def refutations(loop: Record) -> list[str]:
    """Return by which readings recordings refute the rig file, a sentence for each recording."""
    return [
        f"{recording['name']}: {note}"
        for recording in loop.get("recordings", ())
        for note, flag in zip(recording.get("notes", ()), recording.get("flags", ()), strict=False)
        if flag["severity"] == "impossible"
    ]


def lead_sentence(lead: Record) -> str:
    """Return the strongest candidate that is not named, its odds, and why it is not; of a force, the best law too."""
    words = f"the strongest lead is {_refused(lead, '; it is not named')}"
    return f"{words}; the strongest law is {_refused(lead['law'])}" if lead.get("law") else words


def _refused(decision: Record, so: str = "") -> str:
    name, numbers = listed(map(effect_name, decision["effects"])), decision["numbers"]
    return f"{name}, with {chances(numbers.get('odds'))}{so}: {_REASONS[decision['code']](numbers)}"


def effect_sentence(effect: Record) -> str:
    """Return how sure an added effect is; empty for better mechanics, which are no effects of the catalogue."""
    if not effect["evidence"]:
        return ""
    numbers = effect["evidence"]
    words = chances(numbers["odds"])
    if effect["probability"] is not None:
        words += f", {inclusion_words(effect)}"
        # Of smaller odds a reader weighs the number, and must know what it hangs on.
        if numbers["odds"] == numbers.get("against_error") and numbers["odds"] < math.log(_MOST):
            left = "is left beside a law that it looks like" if numbers.get("beside") else "is left"
            far = f"{plain(numbers['size'], 2)} times the model error that {left}"
            words += f"; it moves the prediction by {far}: another law may do the same"
    if effect.get("may_stand_for_unknown"):
        more = plain(numbers["force_instead"])
        words += f"; an unknown force, smooth in position and rate, explains {more} nats more in its place"
    return words


def doubts_answer(code: str, *, complete: bool, named: Sequence[float | None]) -> bool:
    """Return whether a decision doubts an answer, complete or not, with these probabilities of the effects named."""
    sure = bool(named) and all(p is not None and p > 0.9999 for p in named)
    return (code == "laplace" and bool(named) and not sure) or (code == "astray" and not complete)


def decision_sentence(step: Record) -> str:
    """Return why a step of the search was taken, or was not."""
    numbers, code = step["numbers"], step["code"]
    if step["action"] == "mechanics":
        return _mechanics(numbers.get("odds"), accepted=step["accepted"])
    if step["action"] == "exchange":
        old, new = effect_name(step["effects"][0]), listed([effect_name(e) for e in step["effects"][1:]])
        several = len(step["effects"]) > 2
        if code == "contained":
            return f"{'what was added' if several else new} contains {old}"
        if code != "accepted":
            two = f"{new} do as well as {old}, which is another number in every recording"
            return two if several else f"{old} contains {new}, and has too little beyond it: {_REASONS[code](numbers)}"
        return f"with {new} in the place of {old} the log evidence is {plain(numbers['odds'])} nats higher"
    return _REASONS[code](numbers)


def _accepted(numbers: Record) -> str:
    if math.isinf(numbers["train"]) or math.isinf(numbers["held"]):
        return "without it the motion blows up"
    # Where the smallest of the three log odds is that against the model error, the gains alone would mislead.
    limited = "; a model error that looks the same limits them" if numbers["odds"] == numbers["against_error"] else ""
    return f"the log evidence {_both(numbers)}: {chances(numbers['odds'])}{limited}"


def _held_out(numbers: Record) -> str:
    """Return what is missed held out, and by which score: over the intervals of parameters, or by their estimate."""
    held, ahead = numbers["held"], numbers["ahead"]
    if ahead < held and not abs(ahead - held) < _NOTHING:
        alone = _change(ahead, few=True) if abs(ahead) >= _NOTHING else "gains nothing"
        joined = "but" if held > 0 else "and"
        return f"the log evidence {_both(numbers)}, {joined} by its estimate alone it {alone} there"
    # After "gains" in training the verb is said again only of another one.
    missed = f"but {_change(held, few=True).removeprefix('gains ')}" if abs(held) >= _NOTHING else "and nothing"
    alone = f" over the intervals of its parameters; by its estimate alone it gains {plain(ahead)} there"
    alone = alone if held < _NOTHING <= ahead else ""
    return f"the log evidence {_change(numbers['train'])} nats in training, {missed} on the held-out recordings{alone}"


def _is_free(numbers: Record) -> bool:
    """Return whether a model error is expected to move a residual by more than its size in the direction of a law."""
    return bool(2.0 * numbers.get("against_error", math.inf) < numbers["size"] ** 2)


def _laplace(numbers: Record) -> str:
    k = numbers.get("pareto_k", math.inf)
    told = f"their largest weights have Pareto k = {plain(k, 2)}" if LARGEST_K < k < math.inf else "few count"
    return f"the draws of importance sampling cannot be trusted ({told}): probabilities take the posterior as Gaussian"


_REASONS: Mapping[str, Callable[[Record], str]] = {
    "accepted": _accepted,
    "training": lambda numbers: f"the log evidence {_change(numbers['train'], few=True)} nats in training",
    "held_out": _held_out,
    "chance": lambda numbers: (
        f"it {_change(numbers['train'])} nats in training, no more than the best of the catalogue would by chance "
        "from errors like those left"
    ),
    "size": lambda numbers: (
        f"the prediction moves by {plain(numbers['size'], 2)} times the model error that is left, "
        + ("and more is asked of a law that can imitate others" if _is_free(numbers) else "which may look the same")
    ),
    "finite": lambda _: "the motion blows up",
    "predicts_worse": lambda _: "after its last fit the set predicts worse than the declared model",
    "complete": lambda numbers: (
        f"what is left is noise: the best candidate promises a chi-square of {plain(numbers.get('promise'))}, chance "
        f"alone {plain(numbers.get('chance'))}"
    ),
    "sampled": lambda numbers: (
        f"what is not normal about the posterior changes the log evidence by {plain(numbers.get('correction'), 2)} ± "
        f"{plain(numbers.get('error'), 2)} nats (Pareto k {plain(numbers.get('pareto_k'), 2)})"
    ),
    "laplace": _laplace,
    "astray": lambda numbers: (
        f"the declared model leaves {plain(100 * numbers.get('left', math.nan), 2)} % of the variance: check columns, "
        "signs, units, and that [model] holds the main force"
    ),
    "unknown": lambda numbers: f"a force of no law; as a function of position and rate it {_both(numbers)}",
    "exhausted": lambda _: "no other effect, and no pair, is likely enough",
    "contained": lambda _: "what was added contains it",
    "impossible": lambda _: "the system that the rig file declares cannot move as a recording says",
    "budget": budget_sentence,
}


def _mechanics(gain: float | None, *, accepted: bool) -> str:
    if gain is None:
        return "the motion blows up on the simpler mechanics" if accepted else "the motion blows up on them"
    more = "only " if gain > 0 and not accepted else ""
    return f"the log evidence is {more}{plain(abs(gain))} nats {'higher' if gain > 0 else 'lower'} on them"


_NOTHING = 5e-3  # nats: two sets that miss a recording by more than it scatters predict it alike


def _change(value: float, *, few: bool = False) -> str:
    """Return a change of the log evidence as a gain, which may be too `few`, or a loss."""
    return f"gains {'only ' if few else ''}{plain(value)}" if value >= 0 else f"loses {plain(-value)}"


def _both(numbers: Record) -> str:
    """Return how the log evidence changes in training and held out, with one verb where that is the same."""
    train, held = _change(numbers["train"]), _change(numbers["held"])
    if abs(numbers["held"]) < _NOTHING:
        held = "nothing"
    elif (numbers["train"] >= 0) == (numbers["held"] >= 0):
        held = plain(abs(numbers["held"]))
    return f"{train} nats in training and {held} held out"
