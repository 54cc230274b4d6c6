"""The names of jaxdyn.accuracy: for type checkers, and for imports when they are first used."""

from . import convergence as convergence
from . import end_error as end_error
from . import horizon as horizon
from . import quantities as quantities
from . import timing as timing
from . import work_precision as work_precision
from .end_error import EndError as EndError
from .estimates import by_halving as by_halving
from .estimates import by_second_method as by_second_method
from .estimates import by_tangents as by_tangents
from .estimates import estimate as estimate
