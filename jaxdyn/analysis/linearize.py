"""Linearisation of a scene at a state: Jacobian, eigenvalues, verdict, linear modes.

Near an equilibrium y = y* + x the motion is dx/dt = A x, with A the Jacobian of the vector field.
Eigenvalues are computed numbers, so each gets an error bar, and a real part within its bar of 0
decides nothing: the verdict is then "undecided", unless the energy decides (`energy_extremum`).
"""

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._checks import check_first
from jaxdyn.analysis.eigenvalues import (
    ERROR_SAFETY,
    ROUNDING,
    Eigenvalues,
    is_centre,
    rate_eigenvalues,
    rate_verdict,
    with_bars,
)
from jaxdyn.analysis.energy_extremum import is_extremum_of_energy
from jaxdyn.analysis.scales_at_rest import at_rest
from jaxdyn.plan import plan_of
from jaxdyn.scales import groups
from jaxdyn.scene import Field, Scene, check_scene

_MAX_ASYMMETRY = 1e-9  # relative asymmetry of a stiffness matrix that counts as rounding
#: Distance within which a state is on the surface of a condition, in roundings of the state, and
#: the relative difference up to which two rates are equal.
_ROUNDINGS, _SAME_RATE = 64, 1e-12
#: Largest force at an equilibrium, over that at a displacement by its size; likewise of speeds.
_MAX_REST_FORCE = 1e-6


@check_first
@eqx.filter_jit
def jacobian(scene: Scene | Field, y: Array, t=0.0) -> Array:
    """(k, k) derivative of the scene's rate with respect to the state, at (t, y)."""
    return jax.jacfwd(lambda y: scene.rate(jnp.asarray(t, float), y))(y)


@dataclasses.dataclass(frozen=True)
class Linearization:
    """The eigenvalues of a Jacobian and their verdict.

    Attributes:
      jacobian: (k, k) the matrix.
      eigenvalues: (k,) complex, largest real part first [1/s].
      bars: (k,) error bar of each, from rounding of the matrix.
      verdict: "stable" (all real parts certainly negative: perturbations decay; or a centre at
        which a conserved energy has a strict minimum or maximum: they stay small), "unstable" (a
        real part certainly positive), or "undecided".
      portrait: "node", "spiral", "saddle" or "centre"; "mixed" for a combination of these,
        "degenerate" where an eigenvalue may be 0.

    Example:
      >>> from jaxdyn import linearize, scenes
      >>> print(linearize(scenes.pendulum(g=4.0), jnp.zeros(2)))
      Linearization: stable, centre
        eigenvalues  0-2j (+-5e-15), 0+2j (+-5e-15)
    """

    jacobian: np.ndarray
    eigenvalues: np.ndarray
    bars: np.ndarray
    verdict: str
    portrait: str

    @_text.never_raising
    def __repr__(self) -> str:
        rows = [("eigenvalues", with_bars(self.eigenvalues, self.bars))]
        return _text.table(f"Linearization: {self.verdict}, {self.portrait}", rows)

    _repr_html_ = _text.html


@check_first
def linearize(scene: Scene | Field, y: Array, t=0.0) -> Linearization:
    """The eigenvalues of a scene at a state, with error bars and a verdict; host only.

    Args:
      scene: any scene; the verdict is meaningful for autonomous ones.
      y: (k,) state; the verdict is meaningful at equilibria. For steady motions, such as rolling or
        precession, there is `jaxdyn.analysis.steady.linearize_steady`.
      t: () time [s].
    Raises:
      ValueError: `y` or `t` is not finite or has a wrong shape, or the rate has no derivative.
    Limits: at a state at which a condition of the rate changes, as where a spring becomes stiffer,
      the bars contain the eigenvalues on all sides; they are infinite where the rate jumps, as with
      dry friction at rest. A centre is "undecided" where no energy is conserved and has a strict
      minimum or maximum there, as at the libration points L4 and L5.
    Example:
      >>> from jaxdyn.scenes.springs import oscillator
      >>> linearize(oscillator(c=0.1), [0.0, 0.0]).portrait
      'spiral'
    """
    remedy = "Call it outside of jit, grad and vmap; `vibration.modes` takes traced numbers."
    _checks.check_on_host("linearize", (scene, y, t), remedy)
    scene = scene if isinstance(scene, Field) else check_scene(scene)
    _checks.float64()
    y = _checks.array("y", y, (len(scene.system.labels()),))
    t = _checks.array("t", t, ())
    field = scene if isinstance(scene, Field) else scene.field
    return linearize_near(field, y, t, np.abs(y))


def linearize_near(field: Field, y: Array, t, sizes: np.ndarray) -> Linearization:
    """The result of `linearize` for a state (k,) with errors of some roundings of sizes (k,)."""
    t, y = jnp.asarray(t, float), jnp.asarray(y)
    others = _beyond_conditions(field, t, y, jnp.asarray(sizes))
    found = classify(np.asarray(jacobian(field, y, t)), others=others)
    if found.portrait != "centre":
        return found
    near = at_rest(field, groups(field.system), np.asarray(y), float(t))
    held = is_extremum_of_energy(field, t, y, near.sizes, near.time)
    return dataclasses.replace(found, verdict="stable") if held else found


def _beyond_conditions(field: Field, t: Array, y: Array, sizes: Array) -> np.ndarray:
    """(n, k, k) Jacobians on the other side of each condition on whose surface a state lies.

    They are infinite where the rate itself jumps.
    """
    k = len(y)
    if not plan_of(field, k).on_state:
        return np.zeros((0, k, k))
    near, matrices, jumps = map(np.asarray, _each_beyond(field, t, y, sizes))
    # A Jacobian that is undefined, as at a spring of length 0, is left out.
    near = near & np.isfinite(matrices).all(axis=(1, 2))
    return np.where(jumps[near, None, None], np.inf, matrices[near])


@eqx.filter_jit
def _each_beyond(field: Field, t: Array, y: Array, sizes: Array) -> tuple[Array, Array, Array]:
    """For each condition, whether a state is on its surface, and what holds on its other side.

    This is the Jacobian (k, k) there, and whether the rate jumps.
    """
    plan = plan_of(field, len(y))
    rate, here = plan.evaluate(field, t, y)

    def margins(y):
        return plan.evaluate(field, t, y, here.outcomes)[1].margins

    noise = _ROUNDINGS * jnp.finfo(y.dtype).eps * (jnp.abs(jax.jacfwd(margins)(y)) @ sizes)
    near = (jnp.abs(here.margins) <= noise) & ~jnp.asarray(plan.of_time)

    def beyond(i):
        changed = jnp.where(jnp.arange(plan.size) == i, here.beyond, here.outcomes)

        def rate(y):
            return plan.evaluate(field, t, y, changed)[0]

        return jax.jacfwd(rate)(y), rate(y)

    matrices, rates = jax.lax.map(beyond, jnp.arange(plan.size))
    step = jnp.max(jnp.abs(rates - rate[None]), 1)
    return near, matrices, step > _SAME_RATE * jnp.max(jnp.abs(rates) + jnp.abs(rate)[None], 1)


def classify(a, error: float | None = None, others=()) -> Linearization:
    """The result of `linearize` for a given matrix (k, k).

    Args:
      a: the matrix, in any units of the entries of the state.
      error: the norm of its error besides rounding; if given, all entries should be in one unit.
      others: (n, k, k) Jacobians on other sides of conditions, not finite where unknown; the bars
        are widened to contain their eigenvalues.
    """
    remedy = "The rate has no derivative there: coincident bodies, a NaN?"
    a = np.asarray(_checks.array("jacobian", a, (None, None), remedy))
    if a.shape[0] != a.shape[1] or not a.size:
        raise _checks.fail("jacobian", "a square matrix", f"shape {a.shape}")
    found = rate_eigenvalues(a, error)
    for other in others:
        found = found._replace(bars=_bars_that_contain(found, other))
    return Linearization(
        jacobian=a,
        eigenvalues=found.values,
        bars=found.bars,
        verdict=str(rate_verdict(found)),
        portrait=_portrait(found),
    )


def _bars_that_contain(found: Eigenvalues, other: np.ndarray) -> np.ndarray:
    """(k,) bars so wide that each eigenvalue of another matrix is within the nearest one's bar."""
    if not np.isfinite(other).all():
        return np.full(len(other), np.inf)
    apart = np.abs(found.values[:, None] - rate_eigenvalues(other).values)
    bars = np.array(found.bars)
    np.maximum.at(bars, apart.argmin(axis=0), apart.min(axis=0))
    return bars


def _portrait(found: Eigenvalues) -> str:
    re, im = found.values.real, found.values.imag
    up, down, turning = re > found.bars, re < -found.bars, np.abs(im) > found.bars
    if (~up & ~down & ~turning).any():
        return "degenerate"
    if up.any() and down.any():
        return "saddle"
    if is_centre(found):
        return "centre"
    if not (up | down).all() or turning.any() != turning.all():
        return "mixed"
    return "spiral" if turning.all() else "node"


def check_equilibrium(scene: Scene, y: Array, t=0.0) -> None:
    """Raise ValueError unless a state (k,) is an equilibrium, in the scales of motions near it."""
    sizes, time = map(np.asarray, at_rest(scene.field, groups(scene.system), y)[:2])
    rate = np.abs(np.asarray(scene.rate(jnp.asarray(t, float), jnp.asarray(y))))
    if not (rate * float(time) <= _MAX_REST_FORCE * sizes).all():
        got = f"a rate of {rate.max():.3g}"
        remedy = "`equilibria` finds them; steady motions have `analysis.steady.linearize_steady`."
        raise _checks.fail("y", "an equilibrium", got, remedy)


def is_second_order(scene: Scene, y: Array) -> bool:
    """Whether a scene's state is [q, v] with dq/dt = v, by declaration or by its rate at a state.

    Traced numbers are replaced by arbitrary values, since dq/dt = v does not depend on them.
    """
    if scene.system.second_order or scene.system.canonical(jnp.zeros(()), y) is not None:
        return True
    if len(y) % 2:
        return False
    with jax.ensure_compile_time_eval():
        valued, at = jax.tree.map(_with_value, (scene, jnp.asarray(y)))
        top = jacobian(valued, at)[: len(y) // 2]
    if _checks.is_traced(top):  # the rate's function has captured a traced number
        return False
    return np.array_equal(np.asarray(top), np.eye(len(y) // 2, len(y), len(y) // 2))


def complete_state(name: str, given: np.ndarray, scene: Scene) -> np.ndarray:
    """(k,) the whole state; for a state [q, v], v is 0 where only q is given.

    Raises:
      ValueError: it has another number of entries; `name` is that of the argument.
    """
    k, wanted = len(scene.y0), f"{len(scene.y0)} entries"
    if len(given) == k:
        return given
    if is_second_order(scene, scene.y0):
        if 2 * len(given) == k:
            return np.append(given, np.zeros(len(given)))
        wanted = f"{wanted}, or {k // 2} for coordinates at rest"
    raise _checks.fail(name, wanted, len(given))


def _with_value(x: Any) -> Any:
    """A leaf, with some numbers between 1 and 2 in place of traced ones."""
    if not _checks.is_traced(x):
        return x
    return (1 + jnp.arange(1, x.size + 1) / (x.size + 1)).reshape(x.shape).astype(x.dtype)


def mass_matrix(scene: Scene, y: Array, t=0.0) -> Array | None:
    """(n, n) mass matrix of a state [q, v], from its canonical momenta; None without these."""
    t = jnp.asarray(t, float)
    if scene.system.canonical(t, y) is None:
        return None
    q, v = jnp.split(jnp.asarray(y), 2)

    def momentum(v):
        return jnp.split(jnp.asarray(scene.system.canonical(t, jnp.concatenate([q, v]))), 2)[1]

    return jax.jacfwd(momentum)(v)


class Modes(NamedTuple):
    """The small oscillations of a conservative scene about an equilibrium.

    Attributes:
      squares: (n,) squares of the angular frequencies [rad^2/s^2], ascending; negative for an
        unstable mode, exactly 0 where it is within rounding of 0.
      shapes: (n, n) columns: the displacement of the coordinates in each mode, normalised to
        1 = x^T M x.
      mass: (n, n) mass matrix M.
      stiffness: (n, n) stiffness matrix K, the second derivative of the potential energy.
    """

    squares: Array
    shapes: Array
    mass: Array
    stiffness: Array

    __repr__ = _text.fields
    _repr_html_ = _text.html

    @property
    def frequencies(self) -> Array:
        """(n,) angular frequencies [rad/s]; NaN for an unstable mode."""
        return jnp.sqrt(self.squares)


@check_first
def modes(scene: Scene, y: Array | None = None) -> Modes:
    """The linear modes K x = w^2 M x of a conservative scene at an equilibrium.

    Args:
      scene: one whose state is [q, v] and that has canonical momenta, from which M is read.
      y: (k,) equilibrium; the scene's start by default.
    Raises:
      ValueError: the system has no canonical momenta, y is not an equilibrium, or the forces are
        not conservative.
    Limits: differentiable in the scene's numbers; the shapes only where all frequencies are
      distinct. Damping and other velocity-dependent forces are ignored: use `vibration.modes`.
    Example:
      >>> from jaxdyn.scenes.springs import oscillator
      >>> print(modes(oscillator(k=9.0, m=1.0), [0.0, 0.0]).frequencies)
      [3.]
    """
    start = check_scene(scene).y0
    y = _checks.array("y", start if y is None else y, start.shape)
    if scene.system.canonical(jnp.zeros(()), y) is None:
        raise _checks.fail(
            "scene",
            "a system with canonical momenta",
            type(scene.system).__name__,
            "`vibration.modes` takes any system.",
        )
    mass, stiffness, acceleration = _matrices(scene, y)
    if not _checks.is_traced((mass, stiffness, acceleration)):
        _check_modes(scene, *(np.asarray(x) for x in (y, mass, stiffness, acceleration)))
    # M = L L^T reduces it to a standard symmetric problem, which jax can differentiate.
    lower = jnp.linalg.cholesky(mass)
    half = jax.scipy.linalg.solve_triangular(lower, 0.5 * (stiffness + stiffness.T), lower=True)
    reduced = jax.scipy.linalg.solve_triangular(lower, half.T, lower=True)
    squares, vectors = jnp.linalg.eigh(0.5 * (reduced + reduced.T))
    rounding = ERROR_SAFETY * ROUNDING * len(squares) * jnp.max(jnp.abs(squares))
    squares = jnp.where(jnp.abs(squares) <= rounding, 0.0, squares)
    shapes = jax.scipy.linalg.solve_triangular(lower.T, vectors, lower=False)
    return Modes(squares=squares, shapes=shapes, mass=mass, stiffness=stiffness)


@eqx.filter_jit
def _matrices(scene: Scene, y: Array) -> tuple[Array, Array, Array]:
    """(n, n) mass matrix, (n, n) stiffness matrix and (n,) acceleration at y."""
    t = jnp.zeros(())
    q, v = jnp.split(y, 2)

    def acceleration(q):
        return jnp.split(scene.rate(t, jnp.concatenate([q, jnp.zeros_like(v)])), 2)[1]

    mass = mass_matrix(scene, y, t)
    assert mass is not None
    return mass, -mass @ jax.jacfwd(acceleration)(q), acceleration(q)


def _check_modes(scene: Scene, y: np.ndarray, mass, stiffness, acceleration) -> None:
    _checks.finite("stiffness", stiffness, "A number of the scene is NaN, or it is singular at y.")
    # In coordinates in which all masses are 1, all stiffnesses have one unit, as have forces.
    roots = np.sqrt(np.abs(np.diag(mass)))
    stiffness = stiffness / roots / roots[:, None]
    stiffest = np.abs(stiffness).max()
    if np.abs(stiffness - stiffness.T).max() > _MAX_ASYMMETRY * stiffest:
        raise _checks.fail(
            "scene",
            "conservative forces",
            "a stiffness matrix that is not symmetric",
            "`vibration.modes` takes any forces.",
        )
    n = len(mass)
    sizes = np.asarray(at_rest(scene.field, groups(scene.system), y).sizes)
    largest = _MAX_REST_FORCE * (roots * sizes[:n]).max()
    # The kinetic energy is compared with the potential energy of that displacement.
    moves = y[n:] @ mass @ y[n:] > largest**2 * stiffest
    if moves or np.abs(mass @ acceleration / roots).max() > largest * stiffest:
        raise _checks.fail(
            "y",
            "an equilibrium",
            f"velocities {y[n:].tolist()}, accelerations {acceleration.tolist()}",
            "`equilibria.equilibria` finds equilibria.",
        )
