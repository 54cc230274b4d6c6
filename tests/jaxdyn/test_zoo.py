"""Every scene through the same laws; a new scene gets them by being exported.

The rate is finite, the same compiled and not, the same in a batch; its Jacobian is the same
forwards, backwards and by differences, and finite also at rest and at the origin of all
coordinates; the motion runs backwards to where it began; energy is kept where nothing
dissipates; new numbers do not compile again.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import ZOO

from jaxdyn.analysis import energy
from jaxdyn.integrate.simulation import solve
from jaxdyn.scenes import catalogue

ENTRIES = catalogue.entries()
#: Not conservative, or with no energy at all (see each scene's docstring).
DISSIPATIVE_OR_DRIVEN = {"car", "lorenz", "plate", "rod_on_line", "shaken_pendulum", "two_masses"}
DISSIPATIVE_OR_DRIVEN |= {"impact_oscillator", "moved_box", "moved_shape", "turned_box"}
#: They need more than numbers: an effect or a law of force.
MADE_BY_HAND = {"central_orbit", "particle"}
pytestmark = pytest.mark.sample(*ZOO)
SPAN = 0.5  # [time units of the scene], or the scene's own if that is shorter


@pytest.fixture(scope="module", params=sorted(ENTRIES.keys() - MADE_BY_HAND))
def name(request):
    return request.param


@pytest.fixture(scope="module")
def scene(name):
    made = ENTRIES[name].make()
    made.check()
    return made


def jacobians(scene, t, y):
    """Rate, and its Jacobian forwards and backwards."""
    rate = lambda y: scene.rate(t, y)  # noqa: E731
    return rate(y), jax.jacfwd(rate)(y), jax.jacrev(rate)(y)


compiled = eqx.filter_jit(jacobians)


def test_rate_and_jacobian(scene):
    t, y = jnp.asarray(0.1), scene.y0
    rate, forward, reverse = compiled(scene, t, y)
    assert rate.shape == y.shape
    for x in (rate, forward, reverse):
        assert np.isfinite(x).all()
    size = 1.0 + float(jnp.abs(forward).max())
    np.testing.assert_allclose(forward, reverse, rtol=0, atol=1e-11 * size)
    direction = jnp.asarray(np.random.default_rng(1).normal(size=y.shape))
    h = 1e-5
    ends = [compiled(scene, t, y + s * h * direction)[0] for s in (1, -1)]
    difference = (ends[0] - ends[1]) / (2 * h)
    # Third derivatives over h^2, and rounding over h.
    np.testing.assert_allclose(forward @ direction, difference, rtol=0, atol=1e-6 * size)


@pytest.mark.slow
def test_compiled_is_plain_and_a_batch_is_its_lanes(scene):
    t, y = jnp.asarray(0.1), scene.y0
    rate = compiled(scene, t, y)[0]
    size = 1.0 + float(jnp.abs(rate).max())
    np.testing.assert_allclose(scene.rate(t, y), rate, rtol=0, atol=1e-12 * size)
    lanes = jnp.stack([y, 1.001 * y], axis=-1)
    batch = jax.vmap(lambda y: scene.rate(t, y), in_axes=-1, out_axes=-1)(lanes)
    np.testing.assert_allclose(batch[:, 0], rate, rtol=0, atol=1e-12 * size)


def test_finite_derivatives_at_rest(scene):
    y = scene.y0
    if scene.system.labels()[len(y) // 2][0].startswith(("v", "omega")) or scene.second_order:
        y = y.at[len(y) // 2 :].set(0.0)
    rate, forward, reverse = compiled(scene, jnp.asarray(0.0), y)
    for x in (rate, forward, reverse):
        assert np.isfinite(x).all()


@pytest.mark.slow
def test_there_and_back_again(scene, name):
    span = min(SPAN, float(scene.t1))
    out = solve(scene, span, rtol=1e-12)
    assert int(out.status) == 0
    back = solve(scene.starting(out.y1), 0.0, t0=span, rtol=1e-12)
    size = 1.0 + float(jnp.abs(scene.y0).max())
    assert float(jnp.abs(scene.system.difference(back.y1, scene.y0)).max()) < 1e-8 * size
    if name not in DISSIPATIVE_OR_DRIVEN:
        # Relative to the terms of the energy, which may cancel, at the start.
        ts, ys = jnp.array([0.0, span]), jnp.stack([scene.y0, out.y1])
        values = [energy.energy(scene, t, y) for t, y in zip(ts, ys, strict=True)]
        terms = scene.system.energies(ts[0], ys[0], scene.effects)
        scale = sum(abs(float(term)) for term in terms) + 1e-3
        assert abs(float(values[1] - values[0])) < 1e-9 * scale


def test_new_numbers_do_not_compile_again(scene):
    traces = []

    @jax.jit
    def rate(scene, y):
        traces.append(1)
        return scene.rate(jnp.asarray(0.0), y)

    rate(scene, scene.y0)
    rate(jax.tree.map(lambda x: x * 1.01 if eqx.is_inexact_array(x) else x, scene), scene.y0)
    assert len(traces) == 1
