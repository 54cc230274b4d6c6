"""The kinds of special points of branches, in one parameter and in two."""

import enum


class Kind(enum.StrEnum):
    """A kind of special point of a branch: folds and branch points of any, others of one sort.

    Families of equilibria have Hopf points. Those of orbits have period doublings, torus points, at
    which a pair of multipliers crosses the unit circle, and Krein collisions, which only
    conservative scenes have: two pairs on the circle meet and leave it on both sides. They end at
    an equilibrium to which the orbits shrink, a Hopf point or a centre. Those of chains of legs end
    where the chains graze an event; multipliers there are those of the chain that does not touch
    it, if that has any.
    """

    FOLD = "fold"
    BRANCH = "branch point"
    HOPF = "Hopf point"
    DOUBLING = "period doubling"
    TORUS = "torus point"
    KREIN = "Krein collision"
    REST = "equilibrium"
    GRAZING = "grazing"


class CodimensionTwo(enum.StrEnum):
    """A kind of special point of a curve in two parameters, at which two conditions hold.

    Curves of folds and of Hopf points have those up to the double Hopf point, curves of special
    orbits cusps and those after it.
    """

    CUSP = "cusp"
    BOGDANOV_TAKENS = "Bogdanov-Takens point"
    BAUTIN = "Bautin point"
    ZERO_HOPF = "zero-Hopf point"
    DOUBLE_HOPF = "double Hopf point"
    RESONANCE_1_1 = "1:1 resonance"
    RESONANCE_1_2 = "1:2 resonance"
    RESONANCE_1_3 = "1:3 resonance"
    RESONANCE_1_4 = "1:4 resonance"
    FOLD_FLIP = "fold-flip"
    FOLD_TORUS = "fold-torus point"
    FLIP_TORUS = "flip-torus point"
    DOUBLE_TORUS = "double torus point"
