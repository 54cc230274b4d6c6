"""Where functions of the state cross zero within the steps of a motion.

`crossings` determines on which side of events a motion starts and between which samples of a step a
crossing may have been missed, brackets the first crossing, and locates it to rounding.
`event_values` evaluates events with their slopes, signs and rounding and finds which coincide.
`jaxdyn.integrate.events` has `until`, the call for the first crossing, and `all_crossings` has the
one for all of them.
"""
