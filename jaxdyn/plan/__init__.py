"""What is true of a kind of scene, read once from the program of its rate.

`plan` says how the rate depends on time and which conditions it contains, evaluates it with the
outcomes of its conditions given, and has fields evaluated in this way, also where their motion
slides. `bounds` encloses what depends on time alone, `times` finds with these bounds what a step
must not pass over, `period` reads the period of a drive.

May import: `jaxdyn`, that is the files at the top level.

To add an operation that may be a condition, write a rule in `plan`; to add one with bounds, a rule
in `bounds`. An operation without a rule is evaluated as it is.
"""

from jaxdyn.plan.plan import Plan, plan_of

__all__ = ["Plan", "plan_of"]
