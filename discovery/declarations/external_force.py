"""A force that is no effect: whatever else turns the arm, given in time."""

from __future__ import annotations

import sympy as sp

from discovery.declarations.effect import Load
from discovery.declarations.parameters import Normal, Parameter
from discovery.declarations.symbols import omega


class ExternalForce(Load):
    r"""A generalised force on the angle of the tip (an oscillator: on its coordinate), by its value at every instant.

    .. math:: P = f\, \dot\theta_t

    It stands for what a model does not explain, and is therefore in no catalogue: it would explain everything.
    """

    cite = "generalised force; Goldstein, Classical Mechanics, 2nd edition, section 1-4"
    external_force = Parameter("s^-2 q", "force per unit inertia", (-1e3, 1e3), Normal(0.0, 1.0), latex="f")

    def expression(self) -> sp.Expr:
        """Return P."""
        return self.external_force * omega
