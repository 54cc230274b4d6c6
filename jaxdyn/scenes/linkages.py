"""Rods, linkages and closed loops: course problems 21, 25 and 43.

x points right and y up. Constraints lead to differential-algebraic equations; where free
coordinates exist they are offered as well, for comparison.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float, floats
from jaxdyn.effects import SinusoidalForce, UniformGravity, unless_zero
from jaxdyn.formulations.choice import route
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.formulations.mechanism import TIES, Embedding
from jaxdyn.mechanisms.bars import Chain, FreeBars, check_bars
from jaxdyn.mechanisms.four_bar import IN_LINE, FourBar
from jaxdyn.mechanisms.rods import Coupled, Dumbbell, Rods
from jaxdyn.scene import Scene
from jaxdyn.scenes.ready_made import RENAMED, ready_made

_CLOSING_PROJECTIONS = 8  # projections of a rough start onto its ties; each squares the error


@ready_made(but=("speed",))
def rod_on_line(
    *,
    m=(1.0, 1.0),
    length=1.0,
    force=1.0,
    frequency=1.0,
    speed=0.0,
    formulation="constrained",
    drift="projection",
    t1=20.0,
) -> Scene:
    """Two masses on a line, joined by a rod, with an oscillating force on the second (problem 21).

    The force is force sin(frequency t). Unequal speeds are incompatible with a rod: such a start
    is refused, and the nearest valid one is suggested. With drift="raw" it is simulated: the
    equations only require equal accelerations, so the masses separate at constant speed.

    Args:
      m: masses [kg].
      length: length of the rod [m].
      force: amplitude of the force on the second mass [N].
      frequency: frequency of the force [rad/s].
      speed: speed of both at the start [m/s]; for "constrained" also one speed for each.
      formulation: "constrained" in both positions, "newton_euler" and "lagrange" in the first.
      drift: for "constrained": "projection", "baumgarte" or "raw", which shows the drift.
      t1: span [s].
    """
    m, length = floats(m, length)
    free = Coupled(m, length)
    embeddings = {
        "constrained": Embedding(Rods(m=m, length=length[None], pairs=((0, 1),), d=1), free.place)
    }
    v = jnp.asarray(speed, dtype=float)
    system, y0 = route(formulation, free, [0.0], v.ravel()[:1], embeddings, drift)
    if v.ndim:
        _checks.choice("formulation", formulation, ("constrained",))
        y0 = y0.at[2:].set(_checks.array("speed", v, (2,), "One for each mass, or one for both."))
    push = SinusoidalForce(jnp.asarray(force, dtype=float)[None], frequency, on=(1,))
    return Scene(system, (push,), y0=y0, t1=t1)


@ready_made()
def dumbbell(
    *,
    m=(1.0, 1.0),
    length=1.0,
    speed=1.0,
    formulation="constrained",
    drift="projection",
    tie="length",
    t1=20.0,
) -> Scene:
    """Two masses joined by a rod, spinning freely about their centre (problem 25).

    Args:
      m: masses [kg].
      length: length of the rod [m].
      speed: half of the speed of the second mass relative to the first, across the rod [m/s].
      formulation: "constrained" in x and y of both masses (five equations with the rod's
        force), "newton_euler" and "lagrange" in centre and angle.
      drift: for "constrained": "projection", "baumgarte" or "raw".
      tie: for "constrained": "length" differentiates the distance of the masses, "square" its
        square, as the course does; without correction ("raw") they drift differently.
      t1: span [s].
    """
    m, length = floats(m, _checks.positive("length", length, "The rod is in m."))
    free = Dumbbell(m, length)
    squared = _checks.choice("tie", tie, TIES) == "square"
    rods = Rods(m, length[None], ((0, 1),), squared=squared)
    embeddings = {"constrained": Embedding(rods, free.place)}
    spin = 2 * speed / length
    system, y0 = route(formulation, free, [0.0, 0.0, 0.0], [0.0, 0.0, spin], embeddings, drift)
    return Scene(system, (), y0=y0, t1=t1)


@ready_made(renamed=RENAMED)
def four_bar(
    *,
    m=(1.0, 1.0, 1.0),
    length=(1.0, 2.0, 2.0),
    ground=2.0,
    g=1.0,
    angle=2.0,
    rate=0.0,
    crossed=False,
    formulation="constrained",
    drift="projection",
    t1=20.0,
) -> Scene:
    """A linkage of three uniform bars, crank, coupler, rocker, between two hinges (problem 43).

    Args:
      m: masses of crank, coupler and rocker [kg].
      length: length of each [m].
      ground: distance of the far hinge, to the right of the first [m].
      g: gravity [m/s^2].
      angle: angle of the crank at the start, from hanging down [rad].
      rate: rate of that angle at the start [rad/s].
      crossed: whether the coupler lies on the other side of the line from its pin to the far
        hinge.
      formulation: "constrained" in x, y and angle of each bar with all hinges as ties; "loop"
        in the three angles with the far hinge as a tie; "newton_euler" and "lagrange" in the
        crank angle, which is singular where coupler and rocker are in line.
      drift: for "constrained" and "loop": "projection", "baumgarte" or "raw".
      t1: span [s].
    """
    m, length, ground = floats(m, length, ground)
    end = jnp.stack([ground, jnp.zeros_like(ground)])
    free = FourBar(m=m, l=length, end=end, crossed=crossed)
    check_bars(m, length, end, "ground")
    _check_crank(free, angle)
    embeddings = {
        "constrained": Embedding(FreeBars(m, length, end), free.free_bars),
        "loop": free.opened_form(),
    }
    system, y0 = route(formulation, free, [angle], [rate], embeddings, drift)
    return Scene(system, (UniformGravity(g),), y0=y0, t1=t1)


@ready_made("m", "length", "angles", "rates", renamed=RENAMED)
def pinned_chain(
    *,
    m=(1.0, 1.0, 1.0, 1.0),
    length=(1.0, 1.0, 1.0, 1.0),
    span=2.5,
    g=1.0,
    angles=(0.2, 1.0, 2.4, 2.6),
    rates=(0.0, 0.0, 0.0, 0.0),
    formulation="loop",
    drift="projection",
    t1=10.0,
) -> Scene:
    """Uniform bars in a row with both ends pinned at the same height (problem 43).

    Args:
      m: masses [kg].
      length: length of each [m].
      span: distance of the far hinge, to the right of the first [m].
      g: gravity [m/s^2].
      angles: approximate angles, from hanging down [rad]; the nearest pose that closes is taken.
      rates: rates of the angles [rad/s]; the nearest rates that keep it closed are taken.
      formulation: "loop" in the angles with the far hinge as a tie, "constrained" in x, y and
        angle of each bar with all hinges as ties.
      drift: "projection", "baumgarte" or "raw".
      t1: span of time [s].
    """
    m, length, span = floats(m, length, span)
    _checks.choice("formulation", formulation, ("loop", "constrained"))
    end = jnp.stack([span, jnp.zeros_like(span)])
    chain = Chain(m, length, end)
    check_bars(m, length, end, "span")
    q, v = jnp.split(_close(chain, angles, rates), 2)
    # With both ends pinned the chain has no free coordinates; it is embedded in its own angles.
    embeddings = {
        "loop": Embedding(chain, _as_given),
        "constrained": Embedding(FreeBars(m, length, end), chain.free_bars),
    }
    system, y0 = route(formulation, chain, q, v, embeddings, drift)
    return Scene(system, (UniformGravity(g),), y0=y0, t1=t1)


@ready_made("m", "length", "angles", "rates", renamed=RENAMED)
def skate_chain(
    *,
    m=(1.0, 1.0, 1.0),
    length=(1.0, 1.0, 1.0),
    g=0.0,
    angles=(0.5, 1.5, 2.0),
    rates=(1.0, 0.0, 0.0),
    drift="projection",
    t1=10.0,
) -> Scene:
    """Uniform bars in a row on a hinge, the far end on a skate along the last bar (problem 43).

    Args:
      m: masses [kg].
      length: length of each [m].
      g: gravity along -y [m/s^2]; 0 for bars on ice leaves the effect out.
      angles: angles at the start, from hanging down [rad].
      rates: rates of the angles [rad/s]; the nearest rates that the skate allows are taken.
      drift: "projection", "baumgarte" or "raw".
      t1: span [s].
    """
    m, length = floats(m, length)
    chain = Chain(m, length, skate=True)
    y0 = _close(chain, angles, rates)
    return Scene(Constrained(chain, drift), unless_zero(g, UniformGravity(g)), y0=y0, t1=t1)


def _as_given(t: Array, q: Array) -> Array:
    del t
    return q


@jax.jit  # one program, not one for each operation
def _reach(bars: FourBar, angle: Array) -> Array:
    return bars.reach(angle)


def _check_crank(bars: FourBar, angle) -> None:
    """Raise ValueError unless coupler and rocker reach the far hinge without being in line."""
    if _checks.is_traced((bars, angle)):
        return
    reach = float(_reach(bars, as_float(angle)))
    if reach < -IN_LINE:
        raise _checks.fail(
            "angle",
            "an angle of the crank at which coupler and rocker reach the far hinge",
            angle,
            "Turn the crank, move the far hinge (ground), or change the lengths.",
        )
    if reach <= IN_LINE:
        raise _checks.fail(
            "angle",
            "an angle of the crank at which coupler and rocker are not in line",
            angle,
            "There the linkage is at a dead centre or, as a parallelogram, at its change point: "
            "the crank does not determine how the other bars move. Start beside it.",
        )


def _close(chain: Chain, angles, rates) -> Array:
    """(2 n,) the state nearest to a rough one that satisfies the ties of the chain."""
    q, v = floats(angles, rates)
    y, system = jnp.concatenate([q, v]), Constrained(chain)
    for _ in range(_CLOSING_PROJECTIONS if chain.end is not None else 1):
        y = system.nearest(jnp.zeros(()), y)
    return y
