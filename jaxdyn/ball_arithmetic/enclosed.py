"""A number that is known to lie in an interval, as decimal strings and so as plain data."""

from typing import NamedTuple


class Enclosed(NamedTuple):
    """A number within `rad` of `mid`, both decimal strings."""

    mid: str
    rad: str

    def as_json(self) -> dict[str, str]:
        """Both as a JSON object."""
        return self._asdict()

    def __str__(self) -> str:
        return f"{self.mid} +- {self.rad}"
