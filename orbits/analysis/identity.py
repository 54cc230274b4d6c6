"""The invariants of an orbit: numbers independent of its frame, phase and scale.

Two closed orbits can look the same at a closing error of 1e-5 and be different orbits. The
invariants that distinguish them are computed here: whether it is a choreography, its integrals,
the scale-free period T |E|^(3/2) of Newtonian gravity, and, for three equal bodies near the
figure-eight, a normal form in which equal orbits have equal digits.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, _text
from jaxdyn._checks import check_first, fail
from jaxdyn.analysis.energy import angular_momentum, change
from jaxdyn.effects import PairGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scenes import EIGHT
from orbits.analysis.pieces import Periodic, pieces
from orbits.closing.closings import choreography
from orbits.closing.sizes import sizes
from orbits.hybrid.legs import HybridOrbit
from orbits.motion import at_s, gravitates, has_several_points, quick_solve
from orbits.orbit import Orbit, relocate

#: Largest permutation error of a choreography.
CHOREOGRAPHY = 1e-9
#: Largest change along the orbit of a conserved quantity, relative to its terms.
KEPT = 1e-9
_MOMENTS = 32  # times in one period at which conservation is tested
_SAMPLES = 720  # samples of one period, to bracket the passage nearest to the centre
_PASSAGE_STEPS = 8  # Newton steps on the time of that passage


@dataclasses.dataclass(frozen=True)
class Identity:
    """The invariants of an orbit.

    Attributes:
      choreography: whether all bodies follow one curve, evenly spaced in time; None unless
        several points move freely.
      permutation_error: deviation from a choreography: the largest entry, in units of its size, of
        y(T/n) minus the relabelled start, for the better of the two directions; None where bodies
        are not equal.
      energy: kinetic plus potential; None where it is not conserved.
      angular_momentum: about the origin, in the plane of x and y; None where it is not
        conserved.
      scale_free: T |E|^(3/2) over G and the masses, the same in all units and for all scaled
        copies, see `scale_free_period`; None unless all forces are Newtonian attractions.
      units: those of the energy and of the angular momentum; "" where they have none.
    """

    choreography: bool | None
    permutation_error: float | None
    energy: float | None
    angular_momentum: float | None
    scale_free: float | None
    units: tuple[str, str] = ("", "")

    @_text.never_raising
    def __repr__(self) -> str:
        energy, momentum = self.units
        units = {"energy": energy, "angular_momentum": momentum}
        names = (field.name for field in dataclasses.fields(self) if field.name != "units")
        rows = ((name, getattr(self, name), units.get(name, "")) for name in names)
        found = [(name, _text.brief(x, unit)) for name, x, unit in rows if x is not None]
        return _text.table(type(self).__name__, found)

    _repr_html_ = _text.html


@check_first
def identify(orbit: Orbit | HybridOrbit) -> Identity:
    """The invariants of an orbit, where they exist.

    A chain of legs has its energy and angular momentum, where they are the same on all legs.

    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> eight = orbits.find(scenes.three_body(), closing=orbits.choreography(3))
      >>> what = orbits.identify(eight)
      >>> what.choreography, round(what.scale_free, 9)
      (True, 9.237681251)
    """
    e, momentum = conserved_values(orbit)
    first = orbit.legs[0].scene if isinstance(orbit, HybridOrbit) else orbit.scene
    units = first.in_units("J"), first.in_units("kg m^2/s")
    if isinstance(orbit, HybridOrbit):
        return Identity(None, None, e, momentum, None, units)
    system = orbit.scene.system
    error = permutation_error(orbit)
    alike = error is not None and error < CHOREOGRAPHY
    return Identity(
        choreography=alike if has_several_points(system) else None,
        permutation_error=error,
        energy=e,
        angular_momentum=momentum,
        scale_free=None if e is None else scale_free_period(orbit.scene, orbit.period, e),
        units=units,
    )


def scale_free_period(scene: Scene, period: float, energy: float) -> float | None:
    """The scale-free period T |E|^(3/2) of bodies that attract each other, without a unit [1].

    It is T |E|^(3/2) / (G p^(3/2) / m^(1/2)), where m is the mean mass and p the mean product of
    the masses of two bodies; test particles do not count. For equal masses this is
    T |E|^(3/2) / (G m^(5/2)), the value of the literature, which sets G = m = 1. For two bodies it
    is pi / 2 for all masses and ellipses (Kepler's third law). Tables of unequal masses with G = 1
    mostly print T |E|^(3/2) itself, which is this number times p^(3/2) / m^(1/2).

    Args:
      scene: the scene of the motion.
      period: its period [s].
      energy: its energy, kinetic plus potential [J].
    Returns:
      The number; None unless several bodies move under their mutual attraction alone.
    """
    if not gravitates(scene):
        return None
    G, m = float(scene.effects[0].G), np.asarray(scene.system.m)
    m = m[m > 0]
    n, mean = len(m), m.mean() if len(m) else 0.0
    if n < 2 or G == 0:
        return None
    product = (m[1:] / mean) @ np.cumsum(m / mean)[:-1] / (n * (n - 1) / 2)
    # Computed from a speed, since powers of energies and masses may overflow.
    speed = np.sqrt(abs(energy) / mean)
    return float(period * speed**3 / (G * mean) / product**1.5)


def conserved_values(orbit: Periodic) -> tuple[float | None, float | None]:
    """Energy, and angular momentum in the plane of x and y; None if not conserved."""
    # The times are not evenly spaced: equal values at symmetric times would look constant.
    moments = np.linspace(0.0, 1.0, _MOMENTS) ** 1.5
    runs = []
    for piece in pieces(orbit):
        scene = piece.scene
        if not (scene.has_energy or scene.has_points):
            return None, None
        if isinstance(orbit, HybridOrbit) or orbit.s_period is None:
            ts = float(scene.t1) * moments
            ys = piece.states(ts)
        else:
            ts, ys = at_s(scene, orbit.s_period * moments, orbit.rtol)
        runs.append((scene, np.asarray(ts), np.asarray(ys)))
    e = _constant([_energy(*run) for run in runs if run[0].has_energy], len(runs))
    return e, _constant([_momentum(*run) for run in runs if _has_plane(*run)], len(runs))


def _energy(scene: Scene, ts: np.ndarray, ys: np.ndarray) -> tuple[np.ndarray, float]:
    values, size, _ = _changes(scene, ts, ys)
    return np.asarray(values), float(size)


def _has_plane(scene: Scene, ts: np.ndarray, ys: np.ndarray) -> bool:
    """Whether the scene has points in a space of more than one dimension."""
    return scene.has_points and jax.eval_shape(scene.points, ts[0], ys[0]).r.shape[1] > 1


def _momentum(scene: Scene, ts: np.ndarray, ys: np.ndarray) -> tuple[np.ndarray, float]:
    """(s,) angular momentum in the plane of x and y, and its size."""
    momenta, sizes = _momenta(scene, ts, ys)
    return np.asarray(momenta), float(np.asarray(sizes).max())


_changes = jax.jit(change)


@jax.jit
def _momenta(scene: Scene, ts: Array, ys: Array) -> tuple[Array, Array]:
    """(s,) angular momentum in the plane, and (s,) the magnitude of its terms."""

    def at(t, y):
        r, v, m = scene.points(t, y)
        arms = jnp.sum(m * jnp.linalg.norm(r, axis=1) * jnp.linalg.norm(v, axis=1))
        return jnp.ravel(angular_momentum(scene, t, y))[-1], arms

    return jax.vmap(at)(ts, ys)


def _constant(found: list[tuple[np.ndarray, float]], pieces: int) -> float | None:
    """The value common to all pieces, from the values (s,) of each and their size; else None."""
    if len(found) < pieces:
        return None
    values, size = np.concatenate([x for x, _ in found]), max(size for _, size in found)
    return float(values[0]) if np.ptp(values) <= KEPT * size else None


def permutation_error(orbit: Orbit) -> float | None:
    """Largest entry of y(T / n) minus the relabelled start, in sizes; None if bodies differ."""
    system = orbit.scene.system
    if not isinstance(system, FreePoints) or np.ptp(system.m) != 0 or len(system.m) < 2:
        return None
    n = len(system.m)
    flow = quick_solve(orbit.scene, orbit.period / n, rtol=orbit.rtol, solver=orbit.solver)
    end = np.asarray(flow.y1)
    rings, y0 = choreography(n, system.d), np.asarray(orbit.y0)
    entry_sizes = sizes(orbit.scene)
    return min(float(np.abs((end - ring.symmetry.act(y0)) / entry_sizes).max()) for ring in rings)


@check_first
def normal_form(orbit: Orbit) -> Orbit:
    """The same orbit in the frame, phase and scale of the printed figure-eight.

    The centre of mass of the three equal bodies is at rest at the origin. The clock starts where a
    body passes nearest to the centre; this becomes the third body. The first is at distance 1, in
    units of G m = 1, and the third is on the x axis a quarter of a period later. Of the remaining
    mirror images and labels, the one nearest to the printed start is taken (course problem 17:
    first body at (-0.97000436, 0.24308753)).

    Raises:
      ValueError: the orbit is not one of three equal bodies in the plane that move under their
        mutual attraction alone.
    """
    if not has_normal_form(orbit):
        raise fail(
            "orbit",
            "three equal bodies in the plane that attract each other",
            "another scene",
            "The normal form is defined only for these.",
        )
    scene = orbit.scene
    centred = np.concatenate([(x - x.mean(axis=0)).ravel() for x in _points(np.asarray(orbit.y0))])
    t, body = _passage(scene.starting(centred), orbit.period)
    y = _state_after(scene, centred, t)
    r, v = _points(y)
    order = [(body + 1) % 3, (body + 2) % 3, body]
    r, v = r[order], v[order]
    scale = 1.0 / np.linalg.norm(r[0])
    (gravity,), bodies = scene.effects, scene.system
    assert isinstance(gravity, PairGravity)
    assert isinstance(bodies, FreePoints)
    gm = float(gravity.G) * float(np.asarray(bodies.m)[0])
    # Kepler's third law scales lengths by s and times by s^(3/2) sqrt(G m).
    slow = scale**1.5 * np.sqrt(gm)
    r, v, period = scale * r, scale * v / slow, slow * orbit.period
    plain = Scene(system=FreePoints(np.ones(3), d=2), effects=(PairGravity(1.0),), y0=np.zeros(12))
    quarter, _ = _points(_state_after(plain, np.concatenate([r.ravel(), v.ravel()]), period / 4))
    angle = np.arctan2(quarter[2, 1], quarter[2, 0])
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    r, v = r @ turn.T, v @ turn.T
    y0 = min(_images(r, v), key=lambda y: float(np.linalg.norm(y - np.array(EIGHT))))
    return relocate(orbit, plain.starting(y0, period))


def has_normal_form(orbit: Orbit) -> bool:
    """Whether `normal_form` applies: three equal bodies in the plane under gravity alone."""
    scene = orbit.scene
    return (
        gravitates(scene)
        and scene.system.d == 2
        and len(scene.system.m) == 3
        and np.ptp(scene.system.m) == 0
    )


def _points(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    r, v = y.reshape(2, 3, 2)
    return r, v


def _state_after(scene: Scene, y: np.ndarray, t: float) -> np.ndarray:
    return np.asarray(quick_solve(scene.starting(y), t, rtol=1e-14).y1)


def _passage(scene: Scene, period: float) -> tuple[float, int]:
    """Time and body of the passage nearest to the origin, where r . v = 0, by Newton's method."""
    ts = np.arange(_SAMPLES) * period / _SAMPLES
    ys = np.asarray(quick_solve(scene, period, ts=ts, rtol=1e-12).ys)
    distance = np.linalg.norm(ys[:, :6].reshape(-1, 3, 2), axis=-1)
    i, body = np.unravel_index(np.argmin(distance), distance.shape)
    t = float(ts[i])
    for _ in range(_PASSAGE_STEPS):
        y = _state_after(scene, np.asarray(scene.y0), t)
        r, v = (x[body] for x in _points(y))
        a = np.asarray(scene.rate(np.zeros(()), y))[6:].reshape(3, 2)[body]
        t -= float(r @ v / (v @ v + r @ a))
    return t, int(body)


def _images(r: np.ndarray, v: np.ndarray):
    """All mirror images, half turns and labels of the first two bodies that preserve the form."""
    for labels in ([0, 1, 2], [1, 0, 2]):
        for mirror in np.array([[1, 1], [-1, 1], [1, -1], [-1, -1]]):
            yield np.concatenate([(r[labels] * mirror).ravel(), (v[labels] * mirror).ravel()])
