"""The 61 problems of the course, each with the names that answer it and a summary of the answer.

`particles` has problems 1 to 20, `plane` 21 to 39, `space` 40 to 61; `problem` says what a row
is. Names are public ones below `jaxdyn`: ``scenes.pendulum`` is ``jaxdyn.scenes.pendulum``.
Periodic motions and targets (11 b, 27, 28, 38, 43 b) need root finding on top of these scenes,
which is what the orbit finder is for.
"""

from jaxdyn.course.problems.particles import PARTICLES
from jaxdyn.course.problems.plane import PLANE
from jaxdyn.course.problems.problem import Problem
from jaxdyn.course.problems.space import SPACE

__all__ = ["PROBLEMS", "Problem"]

#: All of them by number.
PROBLEMS: dict[int, Problem] = PARTICLES | PLANE | SPACE
