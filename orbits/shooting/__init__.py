"""How the closing equations are solved: Newton's method, segments, logarithmic time.

`finding` is the front door (`orbits.find`), `equations` states what must vanish, `newton` solves
it, `cuts` divides a period into segments, `trivial` knows the directions in which multipliers
must be 1.

May import: `closing`, `orbit`, `motion`.
"""
