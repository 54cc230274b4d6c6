"""The default strategy: one of the others, then collocation where that fails and it may help."""

import dataclasses

from orbits.orbit import Orbit
from orbits.shooting.collocation.search import Collocation
from orbits.shooting.multiple import Shooting
from orbits.shooting.strategy import Search, Strategy


@dataclasses.dataclass(frozen=True)
class Automatic(Strategy):
    """A strategy, followed by `Collocation` where it fails and the guess is stiff.

    Attributes:
      first: the strategy that is tried first.
    """

    first: Strategy = dataclasses.field(default_factory=Shooting)

    def orbit(self, search: Search) -> Orbit:
        """The orbit near the guess, or the best iterate and the reason."""
        orbit = self.first.orbit(search)
        if orbit.ok or search.effort.over or not Collocation.may_help(search, orbit):
            return orbit
        again = Collocation().orbit(dataclasses.replace(search, segments=None))
        return again if again.ok else orbit
