"""Where functions of the state cross zero within the steps of a motion.

`crossings` brackets the first crossing, from samples of each step, and locates it to rounding.
`event_values` evaluates events with their slopes, signs and rounding and finds which coincide,
`beginning` determines on which side of them a motion starts, and `bracketing` between which samples
a crossing may have been missed. `jaxdyn.integrate.events` has `until`, the call for the first
crossing, and `all_crossings` has the one for all of them.
"""
