"""Parameters: what a physical constant is called, its unit, its bounds and what is believed of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from discovery.declarations.priors import Flat, Prior
from discovery.foundation.arguments import expect
from discovery.foundation.errors import InputError


@dataclass(frozen=True)
class Parameter:
    """One physical constant of an effect or a base: the declaration from which fits, priors and reports follow.

    Bounds, prior, default and starts are in natural units, so that one declaration serves an arm in radians and a
    circuit in volts; `natural_scale` turns them into the problem's units.

    Parameters
    ----------
    unit : str
        Exponent string, for example ``"s^-2 q^-2"``, where ``q`` is the unit of the coordinate (rad for an arm) and
        ``u`` that of the recorded input.
    meaning : str
        One clause for tables.
    bounds : tuple of float
        Physical bounds [natural units]; a friction coefficient is >= 0.
    prior : Prior
        Prior density [natural units].
    default : float
        Value at which the effect is absent (amplitudes: zero) or, for shape parameters, an ordinary value.
    starts : tuple of float
        Finite values from which a refit starts; nonlinear effects need several.
    shape : bool
        True when the parameter shapes an effect without switching it (a frequency, a width): it has no own zero.
    threshold : bool
        True for a size beyond which an effect acts: a refit starts from declared ones, as what it does is not in
        proportion to it.
    fixed : bool
        True when the value is known or conventional and is not fitted. The convention of a shape (see `shape`) of an
        effect that the loop adds is fitted at its end, within the prior's width.
    planar : bool
        True when the parameter needs a plane; a system that moves along one line leaves it at its default.
    own : bool
        True when every recording has its own value, such as a phase, fitted beside its initial state. The default is
        that of the first recording, from which the others are counted. It is `fixed` as well.
    begins : str
        The state of a drive whose value it is when a recording begins, fitted with every recording's start from its
        first input; zero of one that begins at rest. It is `fixed` as well.
    natural : bool
        True where physics ends at the bounds, not a range: a value there is one like others.
    latex : str
        Symbol in formulas; the attribute's own name when empty.
    physical : bool
        True for a constant of a declared system: bounds, prior, default and starts are in SI units.
    place : str
        Place of a declared system whose displacement q is.
    forced : bool
        True for an amplitude at such a place: its value is that of a force, `unit` that of a force over an inertia.
    measured : str
        SI unit of its values where they are not in `unit`.
    read : bool
        True for a constant of an instrument: q is then the unit of what is read, not of the coordinate.

    Raises
    ------
    InputError
        For a unit that cannot be read, or bounds in the wrong order.

    Examples
    --------
    >>> mass = Parameter("kg", "mass that moves", bounds=(0.0, 10.0))
    >>> mass.unit, mass.bounds
    ('kg', (0.0, 10.0))
    """

    unit: str
    meaning: str
    bounds: tuple[float, float] = (-math.inf, math.inf)
    prior: Prior = field(default_factory=Flat)
    default: float = 0.0
    starts: tuple[float, ...] = ()
    shape: bool = False
    threshold: bool = False
    fixed: bool = False
    planar: bool = False
    own: bool = False
    begins: str = ""
    natural: bool = False
    latex: str = ""
    name: str = ""
    physical: bool = False
    place: str = ""
    forced: bool = False
    measured: str = ""
    read: bool = False

    def __post_init__(self) -> None:
        from discovery.declarations.units import dimension

        expect(self.unit, str, "unit", 'Give powers of SI units, q and u, as in "s^-2 q^-2"; "1" for none.')
        dimension(self.unit)
        low, high = self.bounds
        if not low <= high:
            raise InputError(f"The bounds of {self.meaning!r} are {self.bounds}; give the lower one first.")

    @property
    def value_unit(self) -> str:
        """Unit of its values: an SI unit, or one with q for that of the coordinate."""
        return self.measured or self.unit

    def __set_name__(self, owner: type, name: str) -> None:
        object.__setattr__(self, "name", name)

    def __get__(self, instance: object, owner: type | None = None):
        """Return the declaration on the class and the sympy symbol on an instance."""
        if instance is None:
            return self
        import sympy as sp

        return sp.Symbol(self.name, real=True)


def natural_scale(unit: str, *, time: float, coordinate: float, length: float = 1.0, drive: float = 1.0) -> float:
    """Return the size of one natural unit in the problem's units.

    Parameters
    ----------
    unit : str
        Exponent string such as ``"s^-2 q^-2"``.
    time : float
        Natural time [s], the inverse of the small-amplitude angular frequency.
    coordinate : float
        Natural coordinate [unit of the coordinate]: 1 rad for an arm, the largest amplitude for an oscillator.
    length : float
        Natural length [m].
    drive : float
        Natural input [unit of the input].

    Returns
    -------
    float
        Product of the natural units raised to their exponents.

    Raises
    ------
    ValueError
        For a unit symbol that has no natural size.
    """
    from discovery.declarations.units import dimension

    sizes = {"s": time, "q": coordinate, "m": length, "rad": 1.0, "u": drive}
    scale = 1.0
    for symbol, exponent in dimension(unit).items():
        if symbol not in sizes:
            raise ValueError(f"unit {unit!r}: {symbol!r} has no natural size; use s, q, u, m or rad")
        scale *= sizes[symbol] ** float(exponent)
    return scale
