"""The numbers that decide, and the budget of work."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf

from discovery.equations.model import Model
from discovery.foundation.arguments import check_fields


@dataclass(frozen=True)
class Budget:
    """How much work a search may do; none of these numbers decides between two sets."""

    most_effects: int = 5  #: Largest number of effects added.
    finished: int = 8  #: Best refits beside a set whose evidence is computed.
    pairs: int = 8  #: Pairs refitted where no single effect is accepted.
    beam: int = 2  #: Refused sets beside which all others are tried.
    offers: int = 7  #: Sets beside which the whole catalogue is refitted.
    dearer: float = 4.0  #: A set whose simulations cost so many times those of the start is not extended, unless
    cheap: int = 5000  #: they take no more than so many steps.
    dear_mechanics: float = 0.5  #: Dearer mechanics come first where they leave no more than this of the model error.


@dataclass(frozen=True)
class LoopSettings:
    """What decides, each number with the study that set it in docs/ATTRIBUTION.md.

    Parameters
    ----------
    nats : float
        Log odds that an effect needs against its absence and against a rival: 20 to 1.
    chance : float
        Level of the parametric bootstrap: an effect must remove more than chance would over the whole catalogue.
    error_scale : float
        Scale of the half-Cauchy prior of the model error [noise sds]. One below twice this counts as none.
    form, form_wide, form_pliable : float
        Model error in the direction of one effect, as a share of the model error that is left: what no catalogue holds
        looks in part like what it holds. Of most systems; of an arm or a law that may imitate others; of one that does.
    law, law_arm : float
        Share of what the accepted effects move the residual that their laws may leave for others.
    tolerance : float
        Trajectory error of the search [rad or natural coordinate], or what noise hides where that is more.
    seed : int
        Of everything random.
    follow_up : bool
        Test the answer against the rig, and design manoeuvres for what the recordings cannot tell apart.
    budget : Budget
        How much work is done. A number out of its range is an InputError.

    Examples
    --------
    >>> LoopSettings().form_of(model := Model("oscillator", ("linear_stiffness",))), LoopSettings().law_of(model)
    (0.45, 0.005)
    """

    nats: float = 3.0
    chance: float = field(default=0.99, metadata={"range": (0.0, 1.0)})
    error_scale: float = 0.15
    form: float = 0.45
    form_wide: float = 1.4
    form_pliable: float = 7.0
    law: float = 0.005
    law_arm: float = 0.045
    tolerance: float = field(default=2e-5, metadata={"range": (0.0, inf, 0.0)})
    seed: int = 1
    follow_up: bool = True
    budget: Budget = Budget()

    def __post_init__(self) -> None:
        check_fields(self)

    def form_of(self, model: Model) -> float:
        """Return the form error of a model's laws."""
        return self.form_wide if model.mechanics.system.has_rod else self.form

    def law_of(self, model: Model) -> float:
        """Return the share by which a model's added laws idealise."""
        return self.law_arm if model.mechanics.system.has_rod else self.law
