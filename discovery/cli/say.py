"""What a loop and a run found, in lines for people, and what doubts it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from discovery.foundation.estimate_text import estimate_text, figures

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from discovery.diagnosis.missing_force import MissingForce
    from discovery.recordings.dataset import Dataset
    from discovery.runs.loop_result import LoopResult

#: Said of what differs between recordings.
_OWN = (
    "; a held-out recording has its own, fitted to it, and any other is predicted with that of the first, within what "
    "they differ by"
)


def say_loop(result: LoopResult) -> None:
    """Say what the loop found: verdict, effects, what is left, and the errors before and after."""
    from discovery.report.contradiction_sentences import contradiction_sentences
    from discovery.report.manoeuvre_sentences import separation_sentence
    from discovery.report.model_error_words import model_error_words
    from discovery.report.sentences import decision_sentence, lead_sentence

    content = result.summary()
    click.echo(f"verdict: {content['verdict']}")
    for effect in content["effects"]:
        click.echo(_effect_line(effect))
    for step in content.get("steps", ()):
        if step["action"] == "exchange" and step["effects"][0] in content.get("given_up", ()):
            click.echo(f"given up: {step['effects'][0]}, which is declared; {decision_sentence(step)}")
    click.echo(f"model error: {model_error_words(content)}")
    if content.get("lead"):
        click.echo(f"lead: {lead_sentence(content['lead'])}")
    for sentence in contradiction_sentences(content.get("contradiction")):
        click.echo(f"contradiction: {sentence}")
    for separation in content.get("separation", ()):
        click.echo(separation_sentence(separation))
    _say_errors(content["errors"])


def say_failed(content: Mapping[str, Any]) -> None:
    """Say why a declared model has no fit, and what would help."""
    from discovery.report.doubt_sentences import failure_sentence, remedy_sentence

    click.echo(f"verdict: {content['verdict']}")
    click.echo(f"failed: {failure_sentence(content['failure'])}")
    click.echo(f"remedy: {remedy_sentence(content['failure'])}")


def say_doubts(sentences: Iterable[str]) -> None:
    """Say what doubts the verdict."""
    for doubt in sentences:
        click.echo(f"doubt: {doubt}")


def say_missing(missing: MissingForce | None) -> None:
    """Say on what a missing force depends."""
    if missing is not None and missing.depends:
        of = " or ".join(", ".join(d.variables) for d in missing.depends)
        patch = "a patch is offered, see missing_force in loop.json" if missing.patch else "no patch is offered"
        click.echo(f"missing force: depends on {of}; {patch}")


def _effect_line(effect: Mapping[str, Any]) -> str:
    """Return an added effect with its values, what serves as well, and how sure it is."""
    from discovery.declarations.registry import effect_name
    from discovery.foundation.start_names import is_start, start_words
    from discovery.mechanics.upgrades import UPGRADES
    from discovery.report.sentences import effect_sentence

    role = "mechanics" if effect["id"] in UPGRADES else "added"
    values = ", ".join(
        " = ".join(
            [start_words(n), *(estimate_text(q["value"], q["sd"], q["unit"]) for q in (p, p.get("physical")) if q)]
        )
        + (f", {p['reason']}" if "reason" in p else "")
        for n, p in effect["parameters"].items()
    )
    values += _OWN if any(is_start(n) for n in effect["parameters"]) else ""
    rivals = f"; as well explained by {', '.join(effect['ambiguous_with'])}" if effect["ambiguous_with"] else ""
    sure, name = effect_sentence(effect), effect_name(effect["id"])
    called = "" if name.lower() == effect["id"].replace("_", " ") else f", the {name}"
    return (
        f"{role}: {effect['id']}{called}" + (f" ({values})" if values else "") + rivals + (f"; {sure}" if sure else "")
    )


def _say_errors(errors: Mapping[str, Any]) -> None:
    """Say the errors before and after, and what was held out where no recording was."""
    from discovery.estimation.holdout import SEPARATE
    from discovery.recordings.parts import MOVES

    for when in ("before", "after"):
        found = errors[when]
        # All held-out recordings may lie inside the trained range, or all beyond it.
        shown = {k: v for k, v in found.items() if k == "holdout" or v != found["holdout"]}
        click.echo(
            f"{when:>6}: "
            + ", ".join(f"{k} rms {figures(v['rms'], 4)} (mean {figures(v['mean'], 4)})" for k, v in shown.items())
            + (f" {errors['unit']}" if errors["unit"] != "1" else "")
        )
    for also in errors.get("also", ()):
        sizes = (
            f"{figures(also['before'][g]['rms'], 4)} -> {figures(also['after'][g]['rms'], 4)}"
            for g in ("train", "holdout")
        )
        unit = f" {also['unit']}" if also["unit"] != "1" else ""
        click.echo(f"also read: {also['name']}, rms {', held out '.join(sizes)}{unit}")
    if errors["holdout_kind"] != SEPARATE:
        moved = errors["holdout_motion"]
        tells = (
            f"its motion is {figures(moved, 2)} times the noise{', too little to judge by' if moved < MOVES else ''}"
        )
        click.echo(f"holdout: the {errors['holdout_kind']}; {tells}; --holdout names a recording of its own")


def say_left_out(pending: Mapping[str, Any] | None) -> None:
    """Say what the time limit has left out."""
    if pending:
        known = pending.get("effective") is not None
        of = f" ({pending['effective']:.0f} of {pending['wanted']:.0f} effective samples)" if known else ""
        on = "with more time, the same command goes on from there"
        click.echo(f"left out for --max-time: {'; '.join(pending['left_out'])}{of}; {on}")


def doubts(result: LoopResult, dataset: Dataset) -> list[str]:
    """Return what doubts the verdict of a loop, a sentence for each fault."""
    from discovery.recordings.flags import doubted, misstated
    from discovery.report.doubt_sentences import caution_sentence, stand_in_sentence
    from discovery.report.sentences import decision_sentence, doubts_answer

    flags = {recording.name: recording.flags for recording in result.recordings}
    named = [found.probability for found in result.named.values()]
    decisions = [s for s in result.steps if doubts_answer(s.code, complete=result.complete, named=named)]
    return [
        *_unfilled(dataset),
        *doubted(flags, complete=result.complete),
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
