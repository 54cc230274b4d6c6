"""The linear part of a stable or unstable manifold: tangents along an orbit, or at an equilibrium.

The stable manifold is the unstable manifold of the reversed motion, and is computed as such:
integrated backwards its tangent grows, and rounding does not. Forwards it would be lost by the
square of the multiplier.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jaxtyping import Array

from jaxdyn import Scene, _checks, _text
from jaxdyn.analysis.eigenvalues import map_in_units
from jaxdyn.analysis.linearize import classify, linearize
from jaxdyn.analysis.monodromy import end_and_derivative
from orbits.analysis.monodromy import tangents_in
from orbits.analysis.stability import stability
from orbits.closing.sizes import sizes, sizes_at_rest
from orbits.motion import quick_solve
from orbits.orbit import Orbit

#: Kinds of manifolds, and the sense of time in which their strands leave.
SENSES = {"unstable": 1.0, "stable": -1.0}
_WEIGHT = 0.1  # entries below this share of a vector's largest do not determine its sign
_REST = 1e-8  # largest change of an equilibrium in the time of the fastest eigenvalue, in sizes
_REAL = 1e-9  # relative imaginary part below which an eigenvalue is real
#: Sine of the angle of two eigenvectors below which they do not span the plane of both eigenvalues.
_PARALLEL = 1e-6


class Directions(NamedTuple):
    """Where the strands of a manifold begin, to first order.

    The map over `span` takes ``base + e * before`` to ``base + e * tangent``, to first order in e.

    Attributes:
      base: (n, k) states on the orbit, or the equilibrium.
      times: (n,) times at which the motion passes them.
      tangent: (n, k) tangents of the manifold, of unit length in units of `each`.
      before: (n, k) their preimages.
      each: (k,) sizes of the entries of a state (`orbits.closing.sizes`).
      span: length of the map in time, negative for a stable manifold.
      rate: rate at which the slowest of the directions grows in the sense of the strands.
      multipliers: (m,) multipliers, or eigenvalues of an equilibrium, to which it belongs.
    """

    base: np.ndarray
    times: np.ndarray
    tangent: np.ndarray
    before: np.ndarray
    each: np.ndarray
    span: float
    rate: float
    multipliers: np.ndarray


def of_orbit(orbit: Orbit, kind: str, n: int, which: int, rtol: float) -> Directions:
    """The tangents at n phases of an orbit that belong to the multiplier number `which`."""
    found = stability(orbit)
    sense, period = SENSES[kind], orbit.period
    size, off = np.abs(found.nontrivial), found.bars
    leaving = size - off > 1 if kind == "unstable" else size + off < 1
    # The multiplier that is farthest from the circle comes first.
    wanted = sorted(found.nontrivial[leaving], key=lambda z: -sense * abs(z))
    value = _choose(wanted, which, f"{kind} multiplier", "See orbits.stability.")
    each = sizes(orbit.scene)
    basis = tangents_in(orbit.scene, each)
    m = map_in_units(end_and_derivative(orbit.scene, sense * period, rtol)[1], each)
    values, vectors = np.linalg.eig(basis.T @ m @ basis)
    i = int(np.argmin(np.abs(values - (value if sense > 0 else 1 / value))))
    v = each * _with_sign(basis @ vectors[:, i].real)
    phases = np.arange(n) / n
    ys, vs = _carry(orbit.scene, sense * period * phases, jnp.asarray(v), rtol)
    vs = np.asarray(vs) / np.linalg.norm(np.asarray(vs) / each, axis=1, keepdims=True)
    growth = float(values[i].real)
    return Directions(
        base=np.asarray(ys),
        times=sense * period * phases,
        tangent=vs,
        before=vs / growth,
        each=each,
        span=sense * period,
        rate=float(np.log(abs(growth))) / period,
        multipliers=np.array([value]),
    )


def of_equilibrium(scene: Scene, y, kind: str, n: int, which: int | None) -> Directions:
    """The tangents at an equilibrium: one for a curve, n on a circle for a surface."""
    y = np.asarray(_checks.array("orbit", y, scene.y0.shape, "An equilibrium is a state."))
    each, sense = sizes_at_rest(scene, y), SENSES[kind]
    near = classify(map_in_units(linearize(scene, y).jacobian, each))
    rate = np.abs(np.asarray(scene.rate(jnp.zeros(()), jnp.asarray(y))))
    if (rate > _REST * np.abs(near.eigenvalues).max() * each).any():
        remedy = "jaxdyn.analysis.equilibria finds equilibria, `equilibrium` polishes one."
        got = f"a state whose rate is {rate.max():.3g}"
        raise _checks.fail("orbit", "an equilibrium", got, remedy)
    leaving = sense * near.eigenvalues.real > near.bars
    basis = tangents_in(scene.starting(y), each)
    a = sense * basis.T @ near.jacobian @ basis
    wanted = sorted(near.eigenvalues[leaving], key=lambda z: (-sense * z.real, -z.imag))
    if which is not None:
        chosen = np.array([_choose(wanted, which, f"{kind} eigenvalue", "leave `which` out")])
    elif 1 <= len(wanted) <= 2:
        chosen = np.array(wanted)
    else:
        expected = f"an equilibrium with one or two {kind} eigenvalues, or `which` of them"
        raise _checks.fail("orbit", expected, len(wanted))
    plane = _invariant(a, sense * chosen)
    b = plane.T @ a @ plane
    turn = 2 * np.pi * np.arange(n) / n
    around = np.stack([np.cos(turn), np.sin(turn)], axis=1) if len(b) == 2 else np.ones((1, 1))
    slowest = float((sense * chosen.real).min())
    back = scipy.linalg.expm(-b / slowest)
    return Directions(
        base=np.broadcast_to(y, (len(around), len(y))),
        times=np.zeros(len(around)),
        tangent=each * (around @ (basis @ plane).T),
        before=each * (around @ (basis @ plane @ back).T),
        each=each,
        span=sense / slowest,
        rate=slowest,
        multipliers=chosen,
    )


def _choose(wanted: list, which: int, what: str, remedy: str) -> complex:
    """The value with the number `which`, if it is real."""
    which = _checks.whole("which", which, 0)
    if which >= len(wanted):
        got = f"{len(wanted)} of them"
        raise _checks.fail("orbit", f"{_text.number_of(which + 1, what)} or more", got, remedy)
    value = wanted[which]
    if abs(value.imag) > _REAL * abs(value):
        got = f"{value:.6g}"
        raise _checks.fail("which", f"a real {what}", got, "Choose another with `which`.")
    return value


def _invariant(a: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """(d, m) an orthonormal basis of the invariant subspace of the chosen eigenvalues."""
    values, vectors = np.linalg.eig(a)
    picked = [int(np.argmin(np.abs(values - z))) for z in chosen]
    v = vectors[:, picked]
    # A complex pair spans the plane of the real and the imaginary part of one vector.
    pair = len(chosen) == 2 and abs(chosen[0].imag) > _REAL * abs(chosen[0])
    v = np.stack([v[:, 0].real, v[:, 0].imag], axis=1) if pair else v.real
    u, r = np.linalg.qr(v)
    if u.shape[1] == 1:
        return _with_sign(u[:, 0])[:, None]
    if abs(r[1, 1]) <= _PARALLEL * np.abs(r).max():  # the eigenvalues are equal, or almost
        order = np.argsort(-values.real)
        cut = values.real[order[1:3]].mean() if len(values) > 2 else -np.inf
        return scipy.linalg.schur(a, sort=lambda re, im: re > cut)[1][:, :2]
    return u * np.sign(np.diag(r))


def _with_sign(v: np.ndarray) -> np.ndarray:
    """The unit vector along v whose first entry that is not small is positive: the branch +1."""
    size = np.abs(v)
    return v * np.sign(v[np.argmax(size > _WEIGHT * size.max())]) / np.linalg.norm(v)


@jax.jit
def _carry(scene: Scene, ts: Array, v: Array, rtol) -> tuple[Array, Array]:
    """(n, k) states at times `ts`, and the tangent v at the start, carried there by the flow."""

    def states(y):
        return quick_solve(scene.starting(y), ts[-1], ts=ts, rtol=rtol).ys

    return jax.jvp(states, (scene.y0,), (v,))
