"""What is true of a kind of scene, read once from the program of its rate.

`plan.Plan` says how the rate depends on time and which conditions it contains; `branches` evaluates
it with the outcomes of its conditions given; `bounds` encloses what depends on time alone.
"""

from jaxdyn.plan.plan import Plan as Plan
from jaxdyn.plan.plan import plan_of as plan_of
