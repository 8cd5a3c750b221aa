"""Forces that are no effects: any one in time, and any smooth function of position and rate."""

from __future__ import annotations

from itertools import product

import sympy as sp

from discovery.declarations.effect import Load
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.symbols import delta, delta_dot, omega

#: Highest power in position and rate together.
_DEGREE = 4
_POWERS = [(j, k) for j, k in product(range(_DEGREE + 1), repeat=2) if j + k <= _DEGREE]


class SmoothForce(Load):
    r"""An unknown force per unit inertia that turns the tip (pushes on a coordinate), smooth in position and rate.

    .. math:: f = \sum_{j + k \le 4} c_{jk}\, \delta^j \dot\delta^k

    It competes with named effects and is therefore in no catalogue. Its coefficients are no constants of a law: they
    are integrated under a Gaussian prior whose size is fitted.
    """

    on = omega
    cite = "an expansion of the restoring force; Masri and Caughey, Journal of Applied Mechanics 46 (1979) 433"

    def expression(self) -> sp.Expr:
        """Return f."""
        return sp.Add(*[getattr(self, _name(j, k)) * delta**j * delta_dot**k for j, k in _POWERS])


def _name(j: int, k: int) -> str:
    return f"smooth_{j}{k}"


for _j, _k in _POWERS:
    _declared = Parameter(
        f"s^{_k - 2} q^{1 - _j - _k}", f"force per position^{_j} rate^{_k}", (-1e3, 1e3), Normal(0.0, 1.0), fixed=True
    )
    setattr(SmoothForce, _name(_j, _k), _declared)
    _declared.__set_name__(SmoothForce, _name(_j, _k))


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
