"""orbits."""

from orbits.problem import PLAIN as PLAIN
from orbits.problem import Closing as Closing
from orbits.problem import Orbit as Orbit
from orbits.problem import Outcome as Outcome
from orbits.problem import SearchError as SearchError
from orbits.problem import choreography as choreography
from orbits.shooting import find as find
