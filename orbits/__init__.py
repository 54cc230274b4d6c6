"""orbits: periodic orbits of jaxdyn's scenes, found, identified, tested for stability, checked.

A tour, from the rough guess of a textbook to Montgomery's figure-eight:

>>> import jaxdyn, orbits
>>> from jaxdyn import scenes
>>> jaxdyn.configure()
>>> scene = scenes.three_body()
>>> plain = orbits.find(scene, scenes.EIGHT_GUESS, scenes.EIGHT_GUESS_PERIOD)
>>> orbits.identify(plain).choreography        # it closes, but is not the eight
False
>>> orbits.stability(plain).verdict
'unstable'
>>> eight = orbits.find(scene, plain.y0, plain.period, closing=orbits.choreography(3))
>>> orbits.identify(eight).choreography, orbits.stability(eight).verdict
(True, 'stable')
>>> round(orbits.normal_form(eight).period, 9)
6.325913983
"""

from orbits import aim as aim
from orbits import hopping as hopping
from orbits import loops as loops
from orbits import seeds as seeds
from orbits.alignment import Match as Match
from orbits.chunk import Box as Box
from orbits.chunk import Rows as Rows
from orbits.closing import PLAIN as PLAIN
from orbits.closing import Closing as Closing
from orbits.closing import Return as Return
from orbits.closing import Reversal as Reversal
from orbits.closing import choreography as choreography
from orbits.closing import relative as relative
from orbits.closing import reversal as reversal
from orbits.conditions import Condition as Condition
from orbits.conditions import Energy as Energy
from orbits.conditions import Period as Period
from orbits.conditions import Section as Section
from orbits.continuation import continue_family as continue_family
from orbits.continuation import switch as switch
from orbits.evidence import closure as closure
from orbits.evidence import digits as digits
from orbits.evidence import recheck as recheck
from orbits.family import Family as Family
from orbits.family import Kind as Kind
from orbits.hybrid import Hybrid as Hybrid
from orbits.hybrid import Leg as Leg
from orbits.hybrid_search import find_chain as find_chain
from orbits.identity import Identity as Identity
from orbits.identity import identify as identify
from orbits.identity import normal_form as normal_form
from orbits.monodromy import monodromy as monodromy
from orbits.plane import search_plane as search_plane
from orbits.problem import Orbit as Orbit
from orbits.problem import Outcome as Outcome
from orbits.problem import SearchError as SearchError
from orbits.same import match as match
from orbits.same import minimal_period as minimal_period
from orbits.same import same as same
from orbits.search import Found as Found
from orbits.search import search as search
from orbits.sensitivity import Solution as Solution
from orbits.sensitivity import solution as solution
from orbits.shooting import find as find
from orbits.stability import Stability as Stability
from orbits.stability import stability as stability
from orbits.symmetry import Symmetry as Symmetry
from orbits.symmetry import backwards as backwards
from orbits.symmetry import of_points as of_points
from orbits.words import syzygies as syzygies
from orbits.words import word as word
