"""The public names of pages: for type checkers, and for imports when they are first used."""

from .content import Check as Check
from .content import Drawing as Drawing
from .content import Number as Number
from .content import Page as Page
from .content import PlayedMotions as PlayedMotions
from .extremes import Largest as Largest
from .extremes import largest as largest
from .register import TOPICS as TOPICS
from .register import Problem as Problem
from .register import problems as problems
from .running import Run as Run
from .running import pictures as pictures
from .running import record as record
from .running import report as report
from .running import run as run
from .running import show as show
from .showing import Display as Display
from .showing import displays as displays
from .showing import equations_of as equations_of
from .showing import formulas as formulas
from .showing import one_file as one_file
