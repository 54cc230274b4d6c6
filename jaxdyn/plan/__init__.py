"""Properties of a kind of scene, read once from the program of its rate.

`plan` says how the rate depends on time and which conditions it contains. `evaluation` runs its
program with the outcomes of these conditions given; `branch` has a field that is evaluated in this
way, also where its motion slides. `continuity` proves at which of them the rate is continuous, so
that no motion slides there. `bounds` encloses what depends on time alone, `times` uses these
bounds to find what a step must not pass over, and `period` reads the period of a forcing.

May import: `jaxdyn`, that is the files at the top level.

To add an operation that may be a condition, write a rule in `evaluation`; to add one with bounds, a
rule in `bounds`, with its arithmetic in `jaxdyn.intervals`. An operation without a rule is taken to
contain no condition, and its result to have no bounds.
"""

from jaxdyn.plan.plan import Plan, plan_of

__all__ = ["Plan", "plan_of"]
