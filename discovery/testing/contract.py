"""The contract as one test class."""

from __future__ import annotations

from typing import ClassVar

from discovery.declarations.registry import catalogue
from discovery.mechanics import base_names
from discovery.testing.declarations import DeclarationContract
from discovery.testing.mechanics import MechanicsContract
from discovery.testing.recovery import check_recovery
from discovery.testing.states import every_effect


class EffectContract(DeclarationContract, MechanicsContract):
    """Tests of effects by law; subclass it in a test module, under a name that starts with ``Test``.

    Attributes
    ----------
    effects : tuple of str or None
        Ids of the effects under test; None: the whole catalogue.
    bases : tuple of str or None
        Bases on which they are tested, where they apply; None: all.
    """

    effects: ClassVar[tuple[str, ...] | None] = None
    bases: ClassVar[tuple[str, ...] | None] = None

    def pytest_generate_tests(self, metafunc) -> None:
        """Run every test for each effect, or for each effect on each base."""
        ids = tuple(catalogue()) if self.effects is None else self.effects
        if "base" not in metafunc.fixturenames and "effect" in metafunc.fixturenames:
            metafunc.parametrize("effect", ids)
            return
        offered = {b: every_effect(b) for b in self.bases or base_names()}
        cases = [(e, b) for b, effects in offered.items() for e in ids if e in effects]
        if "effect" in metafunc.fixturenames:
            metafunc.parametrize(("effect", "base"), cases, ids=[f"{e}-{b}" for e, b in cases])
        elif "base" in metafunc.fixturenames:
            metafunc.parametrize("base", sorted({b for _, b in cases}))

    def test_recovery(self, effect: str) -> None:
        """A fit to a simulated recording with little noise, started 50 % off, returns within 4 sds."""
        check_recovery(effect)
