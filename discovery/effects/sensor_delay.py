"""An instrument that is late."""

from discovery.declarations.effect import Sensor
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Student


class SensorDelay(Sensor):
    r"""The reported output is older than its time stamp.

    .. math:: y_\mathrm{read}(t) = y(t - \tau)

    What is read of the time before the first step follows from the first rate and acceleration; a recording that begins
    `at_rest` still rested then. A lag in what drives the system, such as the L/R of a motor that is left out, looks
    like it where it is short: see `input_lag`. It is offered where an input, or such rest, says when a motion began:
    what starts by itself reads like another start.
    """

    cite = "Ljung, System Identification (1999), section 4.2"
    # In natural times: late by half a swing at most; early only by an offset of the clocks.
    tau = Parameter("s", "delay", (-1.0, 3.0), Student(0.05), starts=(0.01, -0.01), latex=r"\tau")

    def lateness(self):
        """Return the delay [s]."""
        return self.tau
