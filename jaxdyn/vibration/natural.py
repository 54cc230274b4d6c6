"""Natural frequencies, damping ratios and mode shapes of any scene about an equilibrium.

Near an equilibrium y = y* + x the motion obeys dx/dt = A x. An eigenvalue -zeta w +- i w sqrt(1 -
zeta^2) of A belongs to a mode with the natural angular frequency w and the damping ratio zeta. If
the state is [q, v] with dq/dt = v, this is equivalent to M x'' + C x' + K x = 0. Forces need not be
conservative, and damping need not be small or proportional.
"""

import cmath
import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._checks import check_first
from jaxdyn._numerics import nan_unless
from jaxdyn.analysis.eigenvalues import ERROR_SAFETY, ROUNDING, rate_eigenvalues
from jaxdyn.analysis.linearize import check_equilibrium, is_second_order, jacobian, mass_matrix
from jaxdyn.scene import Scene, check_scene


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class NaturalModes:
    """The modes of a scene about an equilibrium, the slowest first.

    Under `jax.vmap` all arrays have further axes, in front.

    Attributes:
      eigenvalues: (m,) complex, one of each conjugate pair [1/s]; real for motions that do not
        oscillate.
      vectors: (k, m) complex; the entries of the state in each mode.
      a: (k, k) the Jacobian at the equilibrium.
      mass: (n, n) mass matrix M; the identity if the masses are not known, as in a plain `ode`;
        None if the state is not [q, v].
      labels: (name, unit) of the entries of the state.
    """

    eigenvalues: Array
    vectors: Array
    a: Array
    mass: Array | None
    labels: tuple[tuple[str, str], ...] = dataclasses.field(metadata={"static": True})

    @property
    def frequencies(self) -> Array:
        """(m,) natural angular frequencies |eigenvalue| [rad/s].

        For a real eigenvalue, which has no frequency, it is the absolute value, as in MATLAB's
        ``damp``, with the damping ratio 1 or -1. See `growth_rates`.
        """
        return jnp.abs(self.eigenvalues)

    @property
    def damped_frequencies(self) -> Array:
        """(m,) angular frequencies of the free oscillations [rad/s]; 0 without oscillation."""
        return jnp.abs(jnp.imag(self.eigenvalues))

    @property
    def damping_ratios(self) -> Array:
        """(m,) damping ratios [1]; negative if a mode grows, NaN at frequency 0."""
        w = self.frequencies
        return nan_unless(w > 0, -jnp.real(self.eigenvalues) / jnp.where(w > 0, w, 1.0))

    @property
    def growth_rates(self) -> Array:
        """(m,) rates at which amplitudes grow, the real parts of the eigenvalues [1/s]."""
        return jnp.real(self.eigenvalues)

    @property
    def shapes(self) -> Array:
        """(n, m) complex coordinates, a column for each mode, whose largest entry is 1.

        If the state is not [q, v], all its entries.
        """
        x = self.vectors if self.mass is None else self.vectors[..., : self.mass.shape[-1], :]
        top = jnp.argmax(jnp.abs(x), axis=-2, keepdims=True)
        return x / jnp.take_along_axis(x, top, axis=-2)

    @property
    def damping(self) -> Array | None:
        """(n, n) matrix C of damping and gyroscopic forces; None if the state is not [q, v]."""
        return self._times_mass(of_rates=True)

    @property
    def stiffness(self) -> Array | None:
        """(n, n) stiffness matrix K; None if the state is not [q, v]."""
        return self._times_mass(of_rates=False)

    def _times_mass(self, *, of_rates: bool) -> Array | None:
        if self.mass is None:
            return None
        n = self.mass.shape[-1]
        columns = slice(n, None) if of_rates else slice(None, n)
        return -self.mass @ self.a[..., n:, columns] + 0.0

    @_text.never_raising
    def __repr__(self) -> str:
        names, time = [name for name, _ in self.labels], _text.second(self.labels)
        rows = []
        found = zip(np.asarray(self.eigenvalues), self.shapes.T, strict=True)
        for number, (value, shape) in enumerate(found, start=1):
            real = float(np.abs(np.imag(shape)).max()) < _REAL
            entries = (
                f"{name} {_entry(complex(x), real)}"
                for name, x in zip(names, np.asarray(shape), strict=False)
            )
            rows.append((f"mode {number}", f"{_in_words(value, time)}: {', '.join(entries)}"))
        return _text.table("Natural modes", rows)

    _repr_html_ = _text.html


def _in_words(value: complex, time: str) -> str:
    """An eigenvalue as a frequency and a damping ratio; a real one as a rate."""
    if value.imag == 0 and value.real != 0:
        rate = _text.brief(abs(float(value.real)), f"1/{time}" if time else "")
        return f"no oscillation, {'grows' if value.real > 0 else 'decays'} at {rate}"
    w = abs(value)
    text = _text.frequency(float(w), time)
    return f"{text}, damping ratio {_text.brief(float(-value.real / w + 0.0))}" if w else text


def _entry(x: complex, real: bool) -> str:
    if real:
        return _text.brief(x.real, digits=4)
    degrees = round(math.degrees(cmath.phase(x)))  # an integer, which has no negative zero
    return f"{_text.brief(abs(x), digits=4)} at {degrees} deg"


_REAL = 1e-9  # imaginary parts of a shape up to this are rounding


@check_first
def modes(scene: Scene, y=None, t=0.0) -> NaturalModes:
    """The natural frequencies, damping ratios and mode shapes of a scene about an equilibrium.

    Args:
      scene: any scene, also a plain `jaxdyn.ode`, with damping or gyroscopic forces.
      y: (k,) an equilibrium; the scene's initial state by default.
      t: () time [s] at which a time-dependent scene is evaluated.
    Raises:
      ValueError: y is not an equilibrium, or of another shape.
    Limits: differentiable with respect to the scene's parameters if eigenvalues are distinct.
      Inside jit, grad and vmap there are always k / 2 modes; those that do not oscillate, whose
      number is not known then, come first and are NaN. Each constraint of a mechanism adds modes of
      frequency 0.
    Reference: Meirovitch (2001), Fundamentals of Vibrations, chapter 7.
    Example:
      >>> from jaxdyn import scenes, vibration
      >>> found = vibration.modes(scenes.oscillator(k=9.0, m=1.0, c=0.6, x=0.0))
      >>> print(found)
      Natural modes
        mode 1  3 rad/s (0.477465 Hz), damping ratio 0.1: x 1
    """
    check_scene(scene)
    y = _checks.array("y", scene.y0 if y is None else y, scene.y0.shape)
    t = _checks.array("t", t, ())
    traced = _checks.is_traced((scene, y, t))
    if not traced:
        check_equilibrium(scene, y, t)
    a = jacobian(scene, y, t)
    mass = mass_matrix(scene, y, t)
    if mass is None and is_second_order(scene, y):
        mass = jnp.eye(len(y) // 2)
    values, vectors = jax.lax.linalg.eig(
        a, compute_left_eigenvectors=False, enable_eigvec_derivs=True
    )
    if traced:
        upper = jnp.argsort(-values.imag)[: len(y) // 2]
        turning = (values.imag > _bars(a, vectors))[upper]
        order = jnp.argsort(jnp.where(turning, jnp.abs(values[upper]), -1.0))
        upper, turning = upper[order], turning[order]
        values, vectors = values[upper], vectors[:, upper]
        values, vectors = nan_unless(turning, values), nan_unless(turning[None], vectors)
    else:
        values = _clear_noise(np.asarray(values), np.asarray(a))
        upper = [i for i in range(len(values)) if values[i].imag >= 0]
        order = np.array(sorted(upper, key=lambda i: (abs(values[i]), values[i].real)))
        values, vectors = jnp.asarray(values[order]), vectors[:, order]
    return NaturalModes(values, vectors, a, mass, tuple(scene.labels()))


def _clear_noise(values: np.ndarray, a: np.ndarray) -> np.ndarray:
    """(k,) eigenvalues; real and imaginary parts that are 0 within their bars become 0."""
    known = rate_eigenvalues(a)
    near = np.abs(values[:, None] - known.values).argmin(axis=1)
    bars = known.bars[near]
    re = np.where(np.abs(values.real) > bars, values.real, 0.0)
    im = np.where(np.abs(values.imag) > bars, values.imag, 0.0)
    return re + 1j * im


def _bars(a: Array, vectors: Array) -> Array:
    """(k,) the error bars of `rate_eigenvalues`, for eigenvectors (k, k) inside a trace."""
    a, vectors = jax.lax.stop_gradient((a, vectors))
    size, k = jnp.abs(a), len(a)
    radius = jnp.max(jnp.abs(jnp.linalg.eigvals(size)))
    shares = jnp.where(radius > 0, size / jnp.where(radius > 0, radius, 1.0), 0.0)

    def further(_, d):
        return jnp.maximum(d, jnp.max(shares * d[None], axis=1))

    d = jnp.exp2(jnp.round(jnp.log2(jax.lax.fori_loop(0, k, further, jnp.ones(k)))))[:, None]
    norm, right = jnp.linalg.norm(a * d.T / d, 2), vectors / d.astype(vectors.dtype)
    left = jnp.linalg.inv(right)  # infinite or NaN for parallel eigenvectors
    condition = jnp.linalg.norm(left, axis=1) * jnp.linalg.norm(right, axis=0)
    error_bound = ERROR_SAFETY * ROUNDING * norm
    return jnp.fmin(condition * error_bound, (2 * norm) ** (1 - 1 / k) * error_bound ** (1 / k))
