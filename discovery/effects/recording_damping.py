"""Viscous friction that is another one in every recording."""

from discovery.declarations.effect import OSCILLATOR, Dissipation
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent, Normal
from discovery.declarations.symbols import v2


class RecordingDamping(Dissipation):
    r"""The viscous friction differs from recording to recording: a bearing that warms up, oil, air, a clamp set anew.

    .. math:: D = \tfrac12\, (\xi_1 + \xi_r)\, v_t^2

    The first recording has :math:`\xi_1` alone, each other one a :math:`\xi_r` of its own beside it; that of a held-out
    one is fitted with its start, and a prediction from inputs alone takes that of the first. It is offered where there
    are several. Recordings of unlike amplitude do not tell it from a loss that depends on that.
    """

    systems = frozenset({OSCILLATOR})
    called = "viscous damping that differs between recordings"
    cite = "Baker and Blackburn, The Pendulum (2005), chapter 3: a bearing's loss differs from run to run"
    reduces_to = frozenset({"viscous_damping"})
    pliable = True
    xi_1 = Parameter(
        "s^-1", "viscous damping in the first recording", (0.0, 1e3), HalfStudent(2.0), starts=(0.01,), latex=r"\xi_1"
    )
    xi_r = Parameter(
        "s^-1", "viscous damping in a recording, beside that in the first", prior=Normal(0.0, 0.02), fixed=True,
        own=True, latex=r"\xi_r",
    )  # fmt: skip

    @classmethod
    def imitates(cls, values, time, duration, step, reach, passes):
        """Return that it does what no other law does in one recording."""
        return False

    def expression(self):
        """Return D."""
        return (self.xi_1 + self.xi_r) * v2 / 2
