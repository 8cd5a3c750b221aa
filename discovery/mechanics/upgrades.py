"""Steps to better mechanics of the arm: what the loop finds when a better base explains what an effect would.

Each is declared as an effect is, but adds no term to a model: it changes the base.
"""

from __future__ import annotations

from typing import ClassVar

from discovery.declarations.effect import ARM, Effect


class Upgrade(Effect):
    """A step from simpler mechanics of the arm to a better base, without a free parameter."""

    kind = "mechanics"
    systems = frozenset({ARM})
    #: Name of the better base.
    base: ClassVar[str]

    @classmethod
    def switch(cls) -> str:
        """Return what it does to a model, as a sentence."""
        return f"Changes the base to `{cls.base}`; no term is added, and no free parameter."


class RadiusInertia(Upgrade):
    r"""The mass moves along the radius law, with centrifugal, Coriolis and radial inertia.

    .. math:: T = \tfrac12\, \rho^2 \dot\theta_t^2 + \tfrac12\, \rho'^2 \dot\delta^2,\qquad
              \rho = \cos\frac{\delta}{\sqrt5} = 1 - \tfrac{1}{10}\, \delta^2 + \dots

    All three inertial terms come from this one energy, see `centrifugal_stiffening`, `coriolis_coupling` and
    `radial_inertia`, which alone have no meaning. The cubic stiffness of the elastica and the mass of the rod come with
    it, to third order.
    """

    base = "reduced"
    cite = "Lagrange's equation of a point mass on the elastica's radius law; source paper, (5), (8) and (16)"


class ElasticaGeometry(Upgrade):
    r"""The exact mechanics of the bending rod, whose mass may move within its stated uncertainty.

    .. math:: \theta(s, t) = \theta_m + \sum_k q_k(t)\, \varphi_k(s),\qquad
              x + \mathrm{i}\, y = \int_0^s e^{\mathrm{i} \theta}\, d\sigma,\qquad
              U = \tfrac16 \int_0^1 \Bigl(\sum_k q_k \varphi_k'\Bigr)^2 ds

    The rod does not stretch, and bends in a few shapes of curvature: large deflection, radius, tension, centrifugal and
    Coriolis terms, the rod's mass and its second mode are contained at every order. Effects are searched on it.
    """

    base = "elastica_calm"
    cite = "Lagrange's equations of an inextensible Euler-Bernoulli rod in curvature modes; source paper, (1) and (7)"


#: By id, each on top of the one before.
UPGRADES: dict[str, Upgrade] = {step.id(): step for step in (RadiusInertia(), ElasticaGeometry())}
