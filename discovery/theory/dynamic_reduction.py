"""The third-order dynamic reduction of the arm, with nothing free."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True)
class DynamicReduction:
    r"""Coefficients of the third-order equation of a mass that moves along the elastica's radius law, (15) extended.

    .. math::
        \ddot\theta_t + \xi \dot\theta_t + \alpha \delta + \beta \delta^3 + c_1 \delta \dot\theta_t^2
        + c_2 \delta \dot\delta \dot\theta_t + c_3 \delta \dot\delta^2
        - c_m \delta^2 \ddot\theta_m + A \ddot\theta_m = 0

    With :math:`\rho = l (1 - \delta^2 / 10)` the generalised force is :math:`\rho F`, the inertia
    :math:`\rho^2 + \rho'^2`; so :math:`\beta / \alpha = 13/210 - 1/10 + 1/5 - 1/25`. Nothing is free.
    `docs/MECHANICS.md` derives these numbers. They belong together: :math:`c_2 = -2 c_1` for any arm, and
    with the motor at rest only the sum of c1, c2 and c3 acts.
    """

    #: The ratio :math:`\beta / \alpha` [-].
    beta: Fraction = Fraction(13, 210) - Fraction(1, 10) + Fraction(1, 5) - Fraction(1, 25)
    #: c1, c2, c3: centrifugal stiffening, Coriolis coupling, radial inertia [-].
    c1: Fraction = Fraction(1, 5)
    c2: Fraction = Fraction(-2, 5)
    c3: Fraction = Fraction(1, 25)
    c_m: Fraction = Fraction(1, 25)  # radial inertia under the motor's acceleration, of a massless rod [-]

    @property
    def effective_beta(self) -> Fraction:
        """The ratio beta / alpha of (15) that has the same frequency at a constant radius, by harmonic balance.

        In free vibration both angles have the same rate, and a term ``delta delta'^2`` acts at the fundamental like
        ``omega^2 / 3`` times ``delta^3``.
        """
        return self.beta + (self.c1 + self.c2 + self.c3) / 3


DYNAMIC_REDUCTION = DynamicReduction()
