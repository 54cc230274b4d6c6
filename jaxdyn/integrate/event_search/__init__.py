"""Where functions of the state cross zero within the steps of a motion.

`crossings` is the search: the samples of each step, and which crossing comes first. `event_values`
evaluates events with their slopes and rounding and tells which coincide, `stretches` says between
which samples a crossing may have gone unseen, `polish` refines its time to full precision.
`jaxdyn.integrate.events` has `until`, the call for the first crossing, and `all_crossings` the one
for all of them.
"""
