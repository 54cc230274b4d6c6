"""The kinds of special points of branches, in one parameter and in two."""

import difflib
import enum

from jaxdyn._text import choice


class _Suggesting(enum.EnumType):
    """Enumerations whose message about a missing member names the nearest one."""

    def __getattr__(cls, name: str):
        # A member may be known by its own name or by what it prints.
        members = cls.__members__
        known = {str(member).upper().replace(" ", "_"): own for own, member in members.items()}
        known |= {own: own for own in members}
        near = difflib.get_close_matches(name.upper(), known, n=1)
        hint = f" Did you mean {cls.__name__}.{known[near[0]]}?" if near else ""
        listed = ", ".join(members)
        message = f"{cls.__name__} has no {name!r}, but {listed}.{hint}"
        raise AttributeError(message, name=name, obj=cls)


class _Named(enum.StrEnum, metaclass=_Suggesting):
    """Members that are equal to what they print, as ``Kind("fold")``."""

    @classmethod
    def _missing_(cls, value):
        choice(cls.__name__, value, [str(member) for member in cls])


class Kind(_Named):
    """A kind of special point of a branch: all branches have folds and branch points, some others.

    Families of equilibria have Hopf points and, in conservative scenes, Krein collisions (also
    called Hamiltonian Hopf points), at which two pairs of imaginary eigenvalues meet and leave the
    axis on both sides. Families of orbits have period doublings, torus points, at which a pair of
    multipliers crosses the unit circle, and, in conservative scenes, Krein collisions, at which two
    pairs on the circle meet and leave it on both sides. They end at an equilibrium to which the
    orbits shrink, a Hopf point or a centre. Families of chains of legs end where the chains graze
    an event; the multipliers there are those of the chain that does not touch it, if that has any.
    """

    FOLD = "fold"
    BRANCH = "branch point"
    HOPF = "Hopf point"
    DOUBLING = "period doubling"
    TORUS = "torus point"
    KREIN = "Krein collision"
    REST = "equilibrium"
    GRAZING = "grazing"


class CodimensionTwo(_Named):
    """A kind of special point of a curve in two parameters, at which two conditions hold.

    Curves of folds and of Hopf points have the kinds up to the double Hopf point; curves of special
    orbits have cusps and the kinds after it.
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
