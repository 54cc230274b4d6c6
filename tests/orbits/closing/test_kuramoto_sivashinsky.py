"""Relative orbits of a truncated partial differential equation, held to published ones.

u_t = -u u_x - u_xx - u_xxxx on a circle of length 22, in 15 complex Fourier modes with mean 0:
Cvitanovic, Davidchack, Siminos (2010), SIAM J. Appl. Dyn. Syst. 9, 1; exponents by Ding,
Cvitanovic (2016), SIAM J. Appl. Dyn. Syst. 15, 1434. It is symmetric under shifts along the circle
and under the reflection u(x) -> -u(-x).
"""

import jax.numpy as jnp
import numpy as np
import pytest
from odes import FLAME_LENGTH as LENGTH
from odes import FLAME_MODES as MODES
from odes import FLAME_ORDERS as ORDERS
from odes import flame, flame_phase
from scipy.integrate import solve_ivp

import jaxdyn
import orbits

#: One unit makes all entries of one size; without units each has its own.
NAMES = [(f"{part} {k}", "1/s") for part in ("real", "imaginary") for k in range(1, MODES + 1)]
REFLECTION = orbits.Symmetry(signs=(-1,) * MODES + (1,) * MODES)


def scene(y0, t1, names=NAMES):
    generators = {"phase": flame_phase}
    return jaxdyn.ode(flame, y0, t1, names=names, params=LENGTH, generators=generators)


def nearest(ys, step, shortest, longest, reflected):
    """The start and time of the closest return of a motion up to a shift, maybe reflected."""
    a = ys[:, :MODES] + 1j * ys[:, MODES:]
    shifts = np.exp(1j * np.outer(ORDERS, np.linspace(0, 2 * np.pi, 128, endpoint=False)))
    best = (np.inf, 0, 0.0)
    for lag in range(round(shortest / step), round(longest / step)):
        later, here = a[lag:], a[:-lag]
        here = -here.conj() if reflected else here
        sizes = (np.abs(later) ** 2 + np.abs(here) ** 2).sum(axis=1)
        missed = sizes - 2 * ((later.conj() * here) @ shifts).real.max(axis=1)
        best = min(best, (missed.min(), int(missed.argmin()), lag * step))
    return ys[best[1]], best[2]


def closes(orbit, image, part):
    """How far SciPy's DOP853 ends from the image of the start, after a part of the period."""
    run = solve_ivp(orbit.scene.vector_field, (0, part), orbit.y0, "DOP853", rtol=1e-12, atol=1e-13)
    return np.abs(run.y[:, -1] - image).max()


def shifted(y, angle):
    a = (y[:MODES] + 1j * y[MODES:]) * np.exp(1j * ORDERS * angle)
    return np.concatenate([a.real, a.imag])


@pytest.mark.slow
@pytest.mark.parametrize("names", [NAMES, None])
def test_an_orbit_that_is_its_own_reflection_after_half_a_period(names):
    y0 = np.zeros(2 * MODES)
    y0[[0, 1, 15, 16]] = 0.1, -0.4, 0.2, 0.1
    ys = np.asarray(jaxdyn.simulate(scene(y0, 300.0), samples=np.arange(0.0, 300.0, 0.2)).ys)
    guess, half = nearest(ys[500:], 0.2, 10.0, 10.6, reflected=True)
    closing = orbits.relative("phase", REFLECTION, 2)
    orbit = orbits.find(scene(guess, half, names), guess, 2 * half, closing=closing)
    assert orbit.closing.frequency == MODES
    assert abs(orbit.period / 2 - 10.25287269) < 1e-8
    y0 = np.asarray(orbit.y0)
    image = shifted(y0 * np.array(REFLECTION.signs), orbit.angle)
    assert closes(orbit, image, orbit.period / 2) < 1e-10
    # A reflection undoes the shift of the part before: the whole period has none.
    assert closes(orbit, y0, orbit.period) < 1e-10
    assert orbits.recheck(orbit).closure < 1e-10
    linear = orbits.stability(orbit)
    assert (linear.verdict, linear.unit) == ("unstable", 2)
    assert {"flow", "phase"} <= set(linear.reasons)
    exponents = np.log(np.abs(linear.nontrivial)) / orbit.period
    assert np.abs(exponents[:2] - 0.033209).max() < 5e-7


@pytest.mark.slow
@pytest.mark.parametrize("names", [NAMES, None])
def test_an_orbit_that_is_shifted_after_a_period(names):
    y0 = np.zeros(2 * MODES)
    y0[:7] = -0.02, -0.1, -0.51, 0.3, 0.08, 0.07, -0.05
    y0[MODES : MODES + 7] = -0.15, -0.22, -0.63, 0.15, 0.05, 0.02, 0.01
    ys = np.asarray(jaxdyn.simulate(scene(y0, 30.0), samples=np.arange(0.0, 30.0, 0.1)).ys)
    guess, period = nearest(ys, 0.1, 16.0, 16.6, reflected=False)
    orbit = orbits.find(scene(guess, period, names), closing=orbits.relative("phase"))
    shift = orbit.angle * LENGTH / (2 * np.pi)
    assert abs(orbit.period - 16.3148) < 5e-5
    assert abs(abs(shift) - 2.8634) < 5e-5
    assert closes(orbit, shifted(np.asarray(orbit.y0), orbit.angle), orbit.period) < 1e-9
    linear = orbits.stability(orbit)
    assert (linear.verdict, linear.unit) == ("unstable", 2)
    exponents = np.log(np.abs(linear.nontrivial)) / orbit.period
    assert abs(exponents[0] - 0.3279) < 5e-5


def test_without_the_symmetry_of_shifts_it_is_refused():
    def pinned(t, y, length):
        return flame(t, y, length) + 0.1 * jnp.eye(2 * MODES)[0]

    y0 = np.full(2 * MODES, 0.1)
    one = jaxdyn.ode(pinned, y0, 1.0, params=LENGTH, generators={"phase": flame_phase})
    with pytest.raises(ValueError, match="turn: expected a symmetry of the scene"):
        orbits.find(one, closing=orbits.relative("phase"))
