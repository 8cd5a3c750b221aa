"""A declared system at rest: inertia, stiffness, and what is read per displacement, at the constants as guessed."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from discovery.declarations import symbols as s
from discovery.declarations.system import SystemDeclaration
from discovery.mechanics.base import Base
from discovery.mechanics.declared_equations import INPUT, Equations, coordinates_of

#: A direction counts as free of springs where what they answer is smaller than so much of the stiffest.
LOOSE = 1e-9


class AtRest(Base):
    """The small motions of a declared system."""

    declaration: ClassVar[SystemDeclaration]
    equations: ClassVar[Equations]

    @cached_property
    def order(self) -> int:
        """Whether positions are read, rates, or accelerations: 0, 1, or 2."""
        return self.order_of(self.equations.output)

    def order_of(self, law: sp.Expr) -> int:
        """Return whether a reading is of positions, of rates, or of accelerations: 0, 1, or 2.

        It is of those that show most in it, at rest, in a motion of them alone at its frequency by the guesses.
        """
        slopes = [self.slopes(law, order) for order in range(3)]
        shown = [np.linalg.norm(way) * self._pace(way) ** order for order, way in enumerate(slopes)]
        if any(shown):
            return int(np.argmax(shown))
        found, (_, rates, accelerations) = law.free_symbols, self.moving
        return 2 if found & {*accelerations, s.alpha_m} else 1 if found & {*rates, s.omega_m} else 0

    def slopes(self, law: sp.Expr, order: int) -> NDArray:
        """Return what a law gains per coordinate, rate or acceleration, as the order says, at rest, shape (n,)."""
        moving = self.moving[order]
        return self.numbers(sp.Matrix([[sp.diff(law, a).subs(dict.fromkeys(moving, 0)) for a in moving]]))[0]

    def _pace(self, way: NDArray) -> float:
        """Return the angular frequency of motions along a way, at the guesses; tiny where nothing pulls back [1/s]."""
        if not way.any():
            return 0.0
        return float(np.sqrt(max(abs(way @ self.stiffness() @ way) / (way @ self.inertia @ way), LOOSE)))

    @cached_property
    def guess(self) -> dict[sp.Symbol, float]:
        """Every constant as declared or guessed."""
        return {sp.Symbol(n, real=True): c.value for n, c in self.declaration.constants.items()}

    @property
    def moving(self) -> tuple[tuple[sp.Symbol, ...], ...]:
        """Coordinates, their rates and their accelerations."""
        return coordinates_of(type(self).n_coordinates)

    def _at_rest(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression where every coordinate, rate, acceleration and input is zero."""
        q, rates, accelerations = self.moving
        return expression.subs(dict.fromkeys((*q, *rates, *accelerations, *INPUT, s.u), 0))

    def stiffness(self) -> NDArray:
        """Return the stiffness matrix at rest, at the constants as declared and guessed, shape (n, n)."""
        return self.numbers(self._stiffness())

    def _stiffness(self) -> sp.Matrix:
        return self._at_rest(sp.hessian(self.equations.potential, self.moving[0]))

    def numbers(self, expression: sp.Expr) -> NDArray:
        """Return an expression at rest, at the declared and guessed constants."""
        return np.array(sp.Matrix(self._at_rest(expression)).xreplace(self.guess).tolist(), float)

    @cached_property
    def inertia(self) -> NDArray:
        """Mass matrix at rest, shape (n, n)."""
        return self.numbers(sp.hessian(self.equations.kinetic, self.moving[1]))

    @cached_property
    def _return(self) -> float:
        """Slope of what is read per displacement along `shape` that ends it [s^-2]; zero where nothing pulls back."""
        way, stiffness = self.shape, self.stiffness()
        pull, most = way @ stiffness @ way, np.abs(way) @ np.abs(stiffness) @ np.abs(way)
        return float(pull / (way @ self.inertia @ way)) if abs(pull) > 1e3 * LOOSE * most else 0.0

    @cached_property
    def gradient(self) -> NDArray:
        """What is read per coordinate, or per rate or acceleration where these are read, at rest, shape (n,)."""
        return self.slopes(self.equations.output, self.order)

    @cached_property
    def shape(self) -> NDArray:
        """Displacement of the coordinates per unit of what is read, as the springs let a slow force do it."""
        way = self.gradient
        if not way.any():
            return way
        stiffness = self.stiffness()
        # Where no spring does a little of the inertia decides: the body moves as a whole.
        small = 1e-9 * max(np.abs(stiffness).max() / np.abs(self.inertia).max(), 1e-12)
        shape = np.linalg.solve(stiffness + small * self.inertia, way)
        return shape / (way @ shape)
