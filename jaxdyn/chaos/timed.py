"""Results of which some numbers are times and rates, and that print these in a scene's unit."""

import equinox as eqx

from jaxdyn._units import in_base_units
from jaxdyn.system import Record


class Timed(Record):
    """Results in the unit of time of a scene.

    Attributes:
      time_unit: its unit of time, "" where it has none.
    """

    time_unit: str = eqx.field(static=True, default="", repr=False, kw_only=True)

    def in_units(self, unit: str) -> str:
        """A unit made of s, such as "1/s", in that of the scene; "" where it has none."""
        return in_base_units(unit, ("m", "kg", self.time_unit)) if self.time_unit else ""
