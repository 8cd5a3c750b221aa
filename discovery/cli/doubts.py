"""What doubts a verdict, said last by the loop: one line for each fault."""

from __future__ import annotations

from typing import TYPE_CHECKING

from discovery.foundation.estimate_text import figures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from discovery.recordings.dataset import Dataset
    from discovery.recordings.recording import Recording
    from discovery.runs.loop_result import LoopResult

__all__ = ["doubts"]


def doubts(result: LoopResult, dataset: Dataset) -> list[str]:
    """Return what doubts the verdict of a loop, a sentence for each fault."""
    from discovery.recordings.flags import UNDERSTATED, doubted, misstated
    from discovery.report.caution_sentences import caution_sentence
    from discovery.report.follow_up_sentences import stand_in_sentence
    from discovery.report.sentences import decision_sentence, doubts_answer

    flags = {recording.name: recording.flags for recording in result.recordings}
    held = [e.recording for e in dataset.holdout or dataset.train]
    cautions = result.cautions
    # A model error is said, and so is a hold-out that is missed; a stated noise that is too small says the same.
    known = (
        not result.complete
        or any(caution.code == "missed" for caution in cautions)
        or any(flag.code == UNDERSTATED for recording in held for flag in recording.flags)
    )
    named = [found.probability for found in result.named.values()]
    decisions = [s for s in result.steps if doubts_answer(s.code, complete=result.complete, named=named)]
    return [
        *_unfilled(dataset),
        *doubted(flags),
        *misstated(flags),
        *(decision_sentence(step.summary()) for step in decisions),
        *(stand_in_sentence(effect, other.summary()) for effect, other in result.stand_ins.items()),
        *(caution_sentence(caution.summary()) for caution in cautions),
        *([] if known else _scattered(result, held)),
    ]


def _unfilled(dataset: Dataset) -> list[str]:
    """Tell that numbers of a draft may still be guesses."""
    rig = dataset.rig
    if not rig.unfilled:
        return []
    return [
        f"the rig file {rig.path} still says FILL IN ({'; '.join(rig.unfilled)}). Sizes and units in the answer count "
        "on what stands there: write what you know, and remove the mark where it is right"
    ]


def _scattered(result: LoopResult, held: Sequence[Recording]) -> list[str]:
    """Tell where averages of what is left are noise, but single readings lie farther off than their noise."""
    import numpy as np

    from discovery.diagnosis.caution import SCATTERED
    from discovery.results.judging import judged_rms

    rms = judged_rms(result.errors)
    # The error is a distance over all channels, and recordings may differ in their noise.
    floor = max((float(np.sqrt(np.sum(np.square(recording.noise)))) for recording in held), default=np.inf)
    if not rms > SCATTERED * floor:
        return []
    unit = result.errors["unit"]
    source = "estimated" if any(recording.noise_estimated for recording in held) else "stated"
    return [
        f"held-out readings lie {figures(rms)} {unit} (rms) from the model, {figures(rms / floor, 2)} times their "
        f"{source} noise of {figures(floor)} {unit}, though averages of what is left are noise: are the time stamps "
        "off, are there spikes, or is the noise larger?"
    ]
