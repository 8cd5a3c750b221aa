"""Which of equally good explanations comes first: the physically simplest one, and last one that imitates others."""

from __future__ import annotations

from discovery.declarations.registry import get_effect


def simplicity(effect: str, system: str) -> tuple[bool, int, bool, bool, str]:
    """Return a key that sorts effects, the physically simplest first.

    What imitates others comes last; then no free parameter before one, one before several, a force before a fault of an
    instrument (of the camera, or of the encoder), and a spring or friction before a load that could feed the motion.

    Parameters
    ----------
    effect : str
        Id.
    system : str
        Kind of system, `discovery.declarations.effect.ARM` or `discovery.declarations.effect.OSCILLATOR`.
    """
    declared = get_effect(effect)
    faulty, load = declared.kind in ("sensor", "drive"), declared.kind == "load"
    return declared.pliable, len(declared.fitted(system)), faulty, load, effect
