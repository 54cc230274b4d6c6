"""The course: which public names answer which of its 61 problems, and answers to single ones.

May import: everything but `cli`.
"""

from jaxdyn.course import rod_or_spring as rod_or_spring
from jaxdyn.course import satellite_claims as satellite_claims
from jaxdyn.course import sleeping_top as sleeping_top
from jaxdyn.course import upright as upright
from jaxdyn.course.problems import PROBLEMS as PROBLEMS
from jaxdyn.course.problems import Problem as Problem
