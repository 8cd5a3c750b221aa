"""What doubts a verdict, said last by the loop: one line for each fault."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from discovery.recordings.dataset import Dataset
    from discovery.runs.loop_result import LoopResult


def doubts(result: LoopResult, dataset: Dataset) -> list[str]:
    """Return what doubts the verdict of a loop, a sentence for each fault."""
    from discovery.recordings.flags import doubted, misstated
    from discovery.report.caution_sentences import caution_sentence
    from discovery.report.follow_up_sentences import stand_in_sentence
    from discovery.report.sentences import decision_sentence, doubts_answer

    flags = {recording.name: recording.flags for recording in result.recordings}
    named = [found.probability for found in result.named.values()]
    decisions = [s for s in result.steps if doubts_answer(s.code, complete=result.complete, named=named)]
    return [
        *_unfilled(dataset),
        *doubted(flags),
        *misstated(flags),
        *(decision_sentence(step.summary()) for step in decisions),
        *(stand_in_sentence(effect, other.summary()) for effect, other in result.stand_ins.items()),
        *(caution_sentence(caution.summary()) for caution in result.cautions),
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
