"""Hard cases: scenes that break naive codes, each with figures of how well it goes and bounds."""

from jaxdyn.hard.case import Case as Case
from jaxdyn.hard.case import Figure as Figure
from jaxdyn.hard.case import Verdict as Verdict
from jaxdyn.hard.case import judge as judge
from jaxdyn.hard.collection import CASES as CASES
from jaxdyn.hard.collection import chosen as chosen
