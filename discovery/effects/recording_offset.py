"""An instrument that was zeroed anew before every recording."""

from discovery.declarations.effect import OSCILLATOR, Sensor
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal, Student


class RecordingOffset(Sensor):
    r"""The zero of the sensor differs from recording to recording: zeroed anew, another origin of a film, another tare.

    .. math:: y_\mathrm{read} = y + z_1 + z_r

    The first recording has :math:`z_1` alone, each other one a :math:`z_r` of its own beside it; that of a held-out one
    is fitted with its start, and a prediction from inputs alone takes that of the first. One recording does not tell it
    from a zero offset (`angle_offset`), and it is offered where there are more. A spring's rest that differs reads the
    same.
    """

    systems = frozenset({OSCILLATOR})
    called = "zero offset that differs between recordings"
    cite = "Doebelin, Measurement Systems, 5th edition (2004), section 3.3"
    reduces_to = frozenset({"angle_offset"})
    z_1 = Parameter("q", "zero offset of the first recording", (-0.5, 0.5), Student(0.02), starts=(0.003, -0.003))
    z_r = Parameter(
        "q", "zero offset of a recording, beside that of the first", prior=Normal(0.0, 0.05), fixed=True, own=True
    )

    def oscillator_reading(self, output):
        """Return the shifted output."""
        return output + self.z_1 + self.z_r
