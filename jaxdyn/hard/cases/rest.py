"""Equilibria that a search may miss, and false ones.

The cases are those of a mass on two springs under weight. The references are independent: SciPy's
`root` from 121 x 121 starts, and mpmath with 40 digits for the weight at which two equilibria
merge.
"""

import math

import numpy as np

from jaxdyn.analysis.equilibria import Equilibria, equilibria
from jaxdyn.hard.case import Case, Figure, absolute_error
from jaxdyn.scene import Scene
from jaxdyn.scenes.particles import cannonball
from jaxdyn.scenes.springs import spring_mass, two_springs

_BOX = [-10.0, -10.0], [10.0, 10.0]
_BOUND = 1e-12  # [m]
#: Numbers (k_b, length_a, length_b, g) of scenes, and their equilibria [m].
OBLIQUE = (
    (
        (8.0, 2.0, 0.8, 1.0),
        (
            (-0.09453065133802983, -0.014723312633883146),
            (0.18453329494735576, 0.30552355056509645),
            (0.22251760279438743, 1.1117533562628241),
            (0.37449022002823606, 1.2214250945666305),
            (1.297303596773926, -0.2246458276765637),
        ),
    ),
    (
        (8.0, 5.0, 0.5, 1.0),
        (
            (-0.15346559885169533, -0.0731488270580656),
            (0.7473073404383143, 0.5757983034029296),
            (1.6734090823822967, 0.6445350862373178),
        ),
    ),
    (
        (0.5, 3.0, 3.0, 2.0),
        (
            (0.13085893705990403, 0.3085084278878568),
            (0.32106733597787374, -4.1221904840601695),
            (0.4205417376422519, 1.7627239375107666),
            (0.5116090793020317, 0.6628476713146307),
        ),
    ),
)
#: Weights [N] in the last of these scenes at which two equilibria merge: F = 0 and det dF/dr = 0.
FOLDS = (1.83115044893896329429, 2.67069709685040944988)
_BESIDE = 1e-7  # [N] distance from that weight; the two are then about 1e-3 m apart


def oblique_springs(k_b: float, length_a: float, length_b: float, g: float) -> Scene:
    """A mass on two springs with anchors at (0, 0) and (0.8, 0.6)."""
    return two_springs(
        anchor_a=(0.0, 0.0),
        anchor_b=(0.8, 0.6),
        k_a=1.0,
        k_b=k_b,
        length_a=length_a,
        length_b=length_b,
        c_a=0.1,
        c_b=0.2,
        c_d=0.05,
        g=g,
    )


def _small_basins() -> tuple[Figure, ...]:
    found = [equilibria(oblique_springs(*numbers), *_BOX) for numbers, _ in OBLIQUE]
    wanted = [np.array(points) for _, points in OBLIQUE]
    pairs = list(zip(found, wanted, strict=True))
    return (
        Figure("equilibria missed", _off([len(w) - len(f) for f, w in pairs]), 0),
        Figure("places [m]", max(absolute_error(f.states[:, :2], w) for f, w in pairs), _BOUND),
        Figure("lists not proved to be complete", _open(found), 0),
    )


def _folds() -> tuple[Figure, ...]:
    weights = [fold + side * _BESIDE for fold in FOLDS for side in (-1, 1)]
    found = [equilibria(oblique_springs(0.5, 3.0, 3.0, g), *_BOX, starts=64) for g in weights]
    counts = [len(f) for f in found]
    gaps = [_nearest(f) for f in (found[1], found[2])]
    return (
        Figure("wrong counts beside the folds", _off(np.subtract(counts, (2, 4, 3, 1))), 0),
        Figure("lists not proved to be complete", _open(found), 0),
        Figure("how far apart those about to vanish are [m]", max(gaps)),
    )


def _none_and_many() -> tuple[Figure, ...]:
    """The figures of a scene without equilibria, and of one with a circle of them."""
    falling = equilibria(cannonball(), [-3.0, -3.0], [3.0, 3.0])
    circle = equilibria(spring_mass(g=0.0, length=0.5), [-1.0, -1.0], [1.0, 1.0], starts=64)
    radii = np.hypot(*circle.states[:, :2].T)
    return (
        Figure("equilibria of a falling ball", len(falling), 0),
        Figure("not proved to have none", _open([falling]), 0),
        Figure("points of a circle called isolated", circle.kinds.count("isolated"), 0),
        Figure("samples of a circle called complete", float(circle.complete), 0),
        Figure("radius of the circle [m]", absolute_error(radii, np.full(len(radii), 0.5)), _BOUND),
    )


def _off(counts) -> float:
    return float(np.abs(counts).sum())


def _open(found: list[Equilibria]) -> float:
    return float(sum(not f.complete for f in found))


def _nearest(found: Equilibria) -> float:
    r = found.states[:, :2]
    apart = np.hypot(*(r[:, None] - r[None]).T)
    return float(np.min(apart + np.diag(np.full(len(r), math.inf))))


CASES = (
    Case("equilibria", "All equilibria are found, also those with small basins.", _small_basins),
    Case("folds", "Equilibria are counted correctly where two are about to vanish.", _folds),
    Case(
        "no-equilibrium",
        "A falling ball has no equilibrium, a mass on a spring a circle of them.",
        _none_and_many,
    ),
)
