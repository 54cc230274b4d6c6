"""What must hold for a motion to be periodic: closings, symmetries, further conditions.

`closings` are ways to close (plainly, as a choreography, up to a rotation, by reversal),
`symmetry` what they are made of, `conditions` fix what a closing leaves free (energy, period, an
entry of the state), `given` checks what a caller gave.

May import: `jaxdyn`. One more closing is one class in `closings`.
"""
