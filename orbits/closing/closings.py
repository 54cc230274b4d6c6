"""What must close: which state has to come where after which part of the period.

The demand decides how far one must integrate and how many numbers are unknown. Plainly,
y(T) = y(0). With a symmetry g of the scene it may be enough that y(T / n) = g y(0): a
choreography of three bodies costs a third of a period. If the motion starts on the set that a
time reversal keeps and meets such a set again, it retraces itself: half of a period, and half
of the unknowns. Up to a rotation by an unknown angle it is a relative periodic orbit.
"""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdyn import Scene, System
from jaxdyn._checks import choice, fail
from orbits.closing.symmetry import EXACT, IDENTITY, Symmetry, of_points

_ANGLES = 64  # tried for the first guess of the angle of a relative orbit
_TURN_STEPS, _TURN_TERMS = 16, 16  # a turn by 2 pi is then right to rounding: 0.4^16 / 16! < 1e-19


class Closing(eqx.Module):
    """What must hold after one part of the period for the motion to be periodic.

    Attributes:
      parts: how many of these parts make a period.
      name: what reports call it.
    """

    parts: eqx.AbstractVar[int]
    name: eqx.AbstractVar[str]

    @property
    def turns(self) -> bool:
        """Whether an angle is among the unknowns."""
        return False

    def free(self, k: int) -> np.ndarray:
        """(p,) the entries of the start that are unknown; the others follow from them."""
        return np.arange(k)

    def start(self, system: System, u: Array, base: Array) -> Float[Array, " k"]:
        """The start with unknowns u (p,); base (k,) is a start of the same kind."""
        del base
        return system.project(jnp.zeros(()), jnp.asarray(u))

    @abc.abstractmethod
    def miss(self, system: System, end: Array, y0: Array, angle: Array) -> Array:
        """What is left of the demand when a part of the motion leads from y0 to end."""

    def after(self, system: System, y0: Array, angle: float, periods: int) -> Array:
        """(k,) where the start has come after some whole periods."""
        del system, angle, periods
        return y0

    def angle(self, system: System, end: Array, y0: Array) -> float:
        """The best guess of the angle for a part of the motion from y0 to end."""
        del system, end, y0
        return 0.0

    def check(self, scene: Scene) -> None:
        """Raise ValueError if this cannot be a closing condition of the scene."""
        del scene
        if not (isinstance(self.parts, int) and self.parts >= 1):
            raise fail("closing", "at least one part of a period", self.parts)


class Return(Closing):
    """y(T / parts) = g y(0), up to a rotation by an unknown angle if `turn` names one.

    Attributes:
      symmetry: g.
      parts: see `Closing`; g applied so often is the identity.
      name: see `Closing`.
      turn: name of the system's generator of the rotation, e.g. "turn in xy"; None for none.
    """

    symmetry: Symmetry = IDENTITY
    parts: int = eqx.field(static=True, default=1)
    name: str = eqx.field(static=True, default="plain closing")
    turn: str | None = eqx.field(static=True, default=None)

    @property
    def turns(self):
        return self.turn is not None

    def act(self, system: System, y: Array, angle) -> Array:
        """g y, turned by the angle [rad]."""
        y = self.symmetry.act(y)
        return y if self.turn is None else _turned(system, self.turn, y, angle)

    def miss(self, system, end, y0, angle):
        return system.difference(end, self.act(system, y0, angle))

    def after(self, system, y0, angle, periods):
        # g has come back to the identity after each period; only the turns add up.
        if self.turn is not None:
            for _ in range(self.parts * periods):
                y0 = _turned(system, self.turn, y0, angle)
        return y0

    def angle(self, system, end, y0):
        if self.turn is None:
            return 0.0
        tries = np.linspace(-np.pi, np.pi, _ANGLES, endpoint=False)
        missed = jax.vmap(lambda angle: self.miss(system, end, y0, angle))(jnp.asarray(tries))
        return float(tries[np.argmin(np.linalg.norm(np.asarray(missed), axis=1))])

    def check(self, scene):
        super().check(scene)
        self.symmetry.check(scene)
        if self.symmetry.reversing:
            raise fail("closing", "a symmetry that keeps the sense of time", "a reversing one")
        if self.turn is not None:
            choice("turn", self.turn, scene.system.generators(scene.y0))
            _check_affine(scene, self.turn)


class Reversal(Closing):
    """The motion starts where one time reversal keeps the state, and comes where another does.

    From there it retraces its way, mirrored. If both reversals are the same one, that is half
    of a period. Otherwise one after the other is a symmetry g, and the period is twice as many
    parts as it takes g to come back to the identity.

    Attributes:
      here: the reversal that keeps the start.
      there: the reversal that keeps the state after a part.
      parts: see `Closing`.
      name: see `Closing`.
    """

    here: Symmetry
    there: Symmetry
    parts: int = eqx.field(static=True, default=2)
    name: str = eqx.field(static=True, default="reversal")

    def free(self, k):
        places, signs = _table(self.here, k)
        index = np.arange(k)
        return index[(places > index) | ((places == index) & (signs > 0))]

    def start(self, system, u, base):
        y = base.at[self.free(len(base))].set(u)
        places, signs = _table(self.here, len(base))
        # Of two entries that change places the later one follows the earlier one.
        follows = np.flatnonzero(places < np.arange(len(base)))
        y = y.at[follows].set(signs[follows] * y[places[follows]])
        return system.project(jnp.zeros(()), y)

    def miss(self, system, end, y0, angle):
        del y0, angle
        places, signs = _table(self.there, len(end))
        index = np.arange(len(end))
        rows = np.flatnonzero((places > index) | ((places == index) & (signs < 0)))
        return 0.5 * system.difference(end, self.there.act(end))[rows]

    def check(self, scene):
        super().check(scene)
        for symmetry in (self.here, self.there):
            symmetry.check(scene)
            places, signs = _table(symmetry, len(scene.y0))
            twice = np.array_equal(places[places], np.arange(len(places)))
            if not (symmetry.reversing and twice and (signs == signs[places]).all()):
                raise fail("closing", "time reversals that undo themselves", "another symmetry")
        off = scene.system.difference(self.here.act(scene.y0), scene.y0)
        if not float(jnp.abs(off).max()) <= EXACT * (1.0 + float(jnp.abs(scene.y0).max())):
            raise fail(
                "y0",
                f"a start that the time reversal of {self.name!r} keeps",
                f"one it moves by {float(jnp.abs(off).max()):.3g}",
                "Give the nearest one that it keeps: (y0 + closing.here.act(y0)) / 2.",
            )


PLAIN = Return()


def choreography(n: int = 3, d: int = 2) -> tuple[Return, Return]:
    """All n bodies on one curve: after T / n each is where the next one was.

    There are two directions round the ring; `find` takes the one its guess is nearer to.

    Args:
      n: number of free points.
      d: dimensions of space.
    """
    bodies = np.arange(n)
    forth, back = (of_points((bodies + step) % n, (1,) * d) for step in (1, -1))
    name = f"choreography of {n}"
    return Return(forth, n, name), Return(back, n, name)


def relative(turn: str = "turn in xy", symmetry: Symmetry = IDENTITY, parts: int = 1) -> Return:
    """The motion comes back turned by an unknown angle: periodic in a rotating frame.

    Args:
      turn: name of the generator of the rotation among ``system.generators``.
      symmetry: what it comes back to, apart from the turn.
      parts: after which part of the period.
    """
    return Return(symmetry, parts, "relative closing", turn)


def reversal(here: Symmetry, there: Symmetry | None = None, parts: int | None = None) -> Reversal:
    """The motion starts, and turns back, where time reversals keep the state.

    Args:
      here: the reversal that keeps the start.
      there: the one that keeps the state after a part of the period; the same if left out.
      parts: how many such parts make a period; 2 for the same reversal.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> swing = orbits.find(
      ...     scenes.pendulum(angle=2.0), period=9.0, closing=orbits.reversal(orbits.backwards(2))
      ... )
      >>> swing.closing.parts
      2
    """
    there = here if there is None else there
    if parts is None and there != here:
        raise fail("parts", "a number where two reversals differ", "none", "2 x the order of both.")
    return Reversal(here, there, 2 if parts is None else parts)


def _table(symmetry: Symmetry, k: int) -> tuple[np.ndarray, np.ndarray]:
    places = np.arange(k) if symmetry.places is None else np.array(symmetry.places)
    return places, np.ones(k) if symmetry.signs is None else np.array(symmetry.signs, float)


def _turned(system: System, turn: str, y: Array, angle) -> Array:
    """The state moved along a generator g(y) = A y + b by an angle: an exponential, by series.

    jax.scipy.linalg.expm does the same and takes seconds to compile.
    """
    origin = system.generators(jnp.zeros_like(y))[turn]
    step = angle / _TURN_STEPS

    def terms(n, term_and_sum):
        term, total = term_and_sum
        along = system.generators(term)[turn] - origin
        along = along + jnp.where(n == 1, origin, 0.0)
        term = along * step / n
        return term, total + term

    def once(_, y):
        return jax.lax.fori_loop(1, _TURN_TERMS, terms, (y, y))[1]

    return jax.lax.fori_loop(0, _TURN_STEPS, once, y)


def _check_affine(scene: Scene, turn: str) -> None:
    def generator(y):
        return scene.system.generators(y)[turn]

    y, zero = scene.y0, jnp.zeros_like(scene.y0)
    straight = 2 * generator(y) - generator(zero)
    if not float(jnp.abs(generator(2 * y) - straight).max()) <= EXACT * (
        1 + float(jnp.abs(y).max())
    ):
        raise fail("turn", "a generator linear in the state", f"{turn!r}", "Use other coordinates.")
