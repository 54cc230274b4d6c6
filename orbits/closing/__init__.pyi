"""The names of orbits.closing: for type checkers, and for imports when they are first used."""

from .closings import Closing as Closing
from .closings import Condition as Condition
from .closings import Reversal as Reversal
from .closings import mirror as mirror
from .closings import symmetric_closing as symmetric_closing
