"""The formulas of a rate in ball arithmetic: any number of digits, and enclosures.

`derivative` differentiates formulas, `arithmetic` has the functions of balls, `program` evaluates
formulas with them, `field` is a rate with its derivatives, `series` has the Taylor coefficients of
its motions, `motion` follows a motion to a number of digits. `enclosure` has the a-priori bound of
a step's motions and the remainder of its Taylor series, `tube` encloses motions with it;
`identities` proves that formulas are equal; `krawczyk` has the theorem by which a box holds exactly
one zero; `zeros` encloses all zeros in a box, with `directions` of unit vectors where a length may
be 0; `decimals` writes balls as decimal strings, and `enclosed` is such a number as plain data. The
formulas are those that `solvers.formulas` takes from the rate's program, with no constant rounded.

May import: `solvers`. It needs python-flint: ``pip install 'jaxdyn[proof]'``.

To add an elementary function, add it to `solvers.formulas`, its derivative to `derivative`, and its
value to `arithmetic` where python-flint has no method of its name.
"""
