"""Where functions of the state cross zero within the steps of a motion.

`crossings` is the search: what is looked at in each step, and which crossing comes first.
`event_values` evaluates events with their slopes and rounding, `stretches` says between which
looks a crossing may have gone unseen, `polish` brings the time of one to the last digit.
`jaxdyn.integrate.events` has the functions that users call.
"""
