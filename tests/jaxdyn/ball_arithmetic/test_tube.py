"""Enclosures of motions and of their derivatives contain what mpmath finds, and are narrow."""

import itertools

import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

import jaxdyn
from jaxdyn.ball_arithmetic import series
from jaxdyn.ball_arithmetic.arithmetic import COMPLEX, acb, arb, precision
from jaxdyn.ball_arithmetic.enclosure import About, Disc, disc
from jaxdyn.ball_arithmetic.field import ball_field, scene_formulas
from jaxdyn.ball_arithmetic.tube import NotEnclosed, tube

BITS, DIGITS = 240, 30
REFERENCE_DIGITS = 50


def _field(rate, k: int):
    return ball_field(scene_formulas(jaxdyn.ode(rate, np.ones(k), 1.0))[0])


def _tube(field, start, span, *, width=0.0, digits=DIGITS, slope_digits=DIGITS, bits=BITS):
    with precision(bits):
        centre = [arb(x) for x in start]
        box = [x + arb(0, width) for x in centre]
        spans = arb(span), arb(span)
        return tube(field, arb(0), centre, box, spans, digits, bits, slope_digits)


def _contains(ball: arb, exact) -> bool:
    """Whether a ball contains a number of mpmath, known to some digits less than it carries."""
    with precision(2 * BITS):
        mid = arb(mpmath.nstr(exact, REFERENCE_DIGITS - 2))
        return bool(ball.contains(mid + arb(0, arb(10) ** (8 - REFERENCE_DIGITS))))


def _all_contained(balls, exact) -> bool:
    return all(_contains(a, b) for a, b in zip(balls, exact, strict=True))


def _widest(balls) -> float:
    return max(float(x.rad()) for x in balls)


@pytest.mark.parametrize("seed", range(3))
def test_linear_motions_are_those_of_the_matrix_exponential(seed):
    random = np.random.default_rng(seed)
    a, start = random.uniform(-1, 1, (3, 3)), random.uniform(-1, 1, 3)
    field, width = _field(lambda t, y: jnp.array(a) @ y, 3), 1e-6
    found = _tube(field, start, 1.5, width=width)
    with mpmath.workdps(REFERENCE_DIGITS):
        flow = mpmath.expm(mpmath.matrix(a.tolist()) * mpmath.mpf(1.5))
        for corner in itertools.product((-1, 0, 1), repeat=3):
            at = [mpmath.mpf(x) + mpmath.mpf(width) * c for x, c in zip(start, corner, strict=True)]
            assert _all_contained(found.box, list(flow * mpmath.matrix(at)))
        assert _all_contained(found.centre, list(flow * mpmath.matrix(start.tolist())))
        assert _all_contained(found.slopes.entries(), list(flow))
    # The box grows as the derivative says, not more: no wrapping.
    growth = np.abs(np.array(flow.tolist(), float)).sum(axis=1)
    assert np.allclose([float(x.rad()) for x in found.box], growth * width, rtol=1e-6)
    assert _widest([*found.centre, *found.slopes.entries()]) < 1e-26


def _kepler(size, e, t):
    """The state a time t after the pericentre of an orbit about a unit mass, closed form."""
    anomaly = mpmath.findroot(lambda u: u - e * mpmath.sin(u) - t / size**1.5, t)
    cos, sin, root = mpmath.cos(anomaly), mpmath.sin(anomaly), mpmath.sqrt(1 - e * e)
    speed = 1 / (mpmath.sqrt(size) * (1 - e * cos))
    return [size * (cos - e), size * root * sin, -speed * sin, speed * root * cos]


def test_kepler_motions_and_their_derivatives_are_those_of_the_closed_form():
    def rate(t, y):
        r = jnp.sqrt(y[0] ** 2 + y[1] ** 2)
        return [y[2], y[3], -y[0] / r**3, -y[1] / r**3]

    span = 2.0
    with mpmath.workdps(REFERENCE_DIGITS):
        # From the float 0.5 at the pericentre, and the float nearest to its speed.
        near, speed = mpmath.mpf(0.5), mpmath.mpf(float(mpmath.sqrt(3)))
        size = 1 / (2 / near - speed**2)
        e = 1 - near / size
        field = _field(rate, 4)
        found = _tube(field, [0.5, 0.0, 0.0, float(speed)], span)
        assert _all_contained(found.centre, _kepler(size, e, span))
        assert _widest(found.centre) < 1e-26
        # By the distance and by the speed at the pericentre: columns 0 and 3.
        for column, way in ((0, (1, 0)), (3, (0, 1))):

            def moved(x, way=way):
                r, v = near + x * way[0], speed + x * way[1]
                a = 1 / (2 / r - v * v)
                return _kepler(a, 1 - r / a, span)

            h = mpmath.mpf(10) ** -10
            with mpmath.workdps(REFERENCE_DIGITS + 30):
                pairs = zip(moved(h), moved(-h), moved(2 * h), moved(-2 * h), strict=True)
                slopes = [(8 * (a - b) - (c - d)) / (12 * h) for a, b, c, d in pairs]
            exact = [row[column] for row in found.slopes.tolist()]
            with precision(BITS):
                misses = [x - arb(mpmath.nstr(s, 40)) for x, s in zip(exact, slopes, strict=True)]
                assert all(abs(float(x)) < 1e-25 for x in misses)


def _polynomial(seed: int, k: int, degree: int):
    """A random field for JAX or mpmath, and its Jacobian."""
    random = np.random.default_rng(seed)
    powers = [n for n in itertools.product(range(degree + 1), repeat=k) if sum(n) <= degree]
    table = random.uniform(-1, 1, (k, len(powers))).tolist()

    def monomial(y, n):
        product = 1
        for x, power in zip(y, n, strict=True):
            product = product * x**power
        return product

    def rate(y):
        return [sum(c * monomial(y, n) for c, n in zip(row, powers, strict=True)) for row in table]

    def jacobian(y):
        def slope(row, j):
            lower = [tuple(p - (i == j) for i, p in enumerate(n)) for n in powers]
            terms = zip(row, powers, lower, strict=True)
            return sum(c * (n[j] * monomial(y, m)) for c, n, m in terms if n[j])

        return [[slope(row, j) for j in range(k)] for row in table]

    return rate, jacobian


def _reference(rate, jacobian, start, span):
    """State and derivative by mpmath's Taylor integrator, of the variational equations."""
    k = len(start)

    def whole(t, z):
        y, phi = z[:k], [z[k + i * k : k + (i + 1) * k] for i in range(k)]
        a = jacobian(y)
        moved = [sum(a[i][m] * phi[m][j] for m in range(k)) for i in range(k) for j in range(k)]
        return [*rate(y), *moved]

    unit = [mpmath.mpf(int(i == j)) for i in range(k) for j in range(k)]
    return mpmath.odefun(whole, 0, [*start, *unit])(span)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, *(pytest.param(i, marks=pytest.mark.slow) for i in (1, 2, 3))])
def test_motions_of_random_polynomial_fields_are_enclosed(seed):
    k, width, span = 2 + seed % 2, 1e-9, 0.5
    random = np.random.default_rng(100 + seed)
    rate, jacobian = _polynomial(seed, k, 3 if seed else 2)
    start = random.uniform(-0.5, 0.5, k)
    found = _tube(_field(lambda t, y: rate(y), k), start, span, width=width)
    thin = _tube(_field(lambda t, y: rate(y), k), start, span)
    with mpmath.workdps(REFERENCE_DIGITS):
        for way in (np.zeros(k), random.uniform(-1, 1, k)):
            at = [
                mpmath.mpf(x) + mpmath.mpf(width) * mpmath.mpf(c)
                for x, c in zip(start, way, strict=True)
            ]
            exact = _reference(rate, jacobian, at, span)
            assert _all_contained(found.box, exact[:k])
            assert _all_contained(found.slopes.entries(), exact[k:])
            if not way.any():
                assert _all_contained([*thin.box, *thin.slopes.entries()], exact)
    assert _widest([*thin.box, *thin.slopes.entries()]) < 1e-25


def test_the_width_decreases_with_the_digits_and_with_the_step():
    field = _field(lambda t, y: [y[1], -y[0] - y[0] ** 3], 2)
    widths = [_widest(_tube(field, [1.0, 0.5], 1.0, digits=n).centre) for n in (20, 30, 50)]
    assert widths[1] < 1e-9 * widths[0]
    assert widths[2] < 1e-19 * widths[1]
    bounds = Disc(radius=arb(1), state=[arb(1)], start=[arb(1)])
    for order in (5, 20):
        long, short = (float(bounds.remainder(arb(q), order)[0]) for q in (0.25, 0.125))
        assert np.isclose(long / short, 2.0 ** (order + 1) * (1 - 0.125) / (1 - 0.25), rtol=1e-12)


def test_derivatives_of_more_digits_than_the_motion_are_not_cut_off():
    # The derivative is exp(e^t - 1) whatever the state, whose series is short.
    found = _tube(_field(lambda t, y: [y[0] * jnp.exp(t)], 1), [0.0], 1.0, digits=1)
    with mpmath.workdps(REFERENCE_DIGITS):
        (slope,) = found.slopes.entries()
        assert _contains(slope, mpmath.exp(mpmath.e - 1))
        assert float(slope.rad()) < 1e-27


def test_a_coefficient_that_was_cut_off_is_not_read_as_zero():
    field = _field(lambda t, y: [y[0] ** 2], 1)
    with precision(BITS, 5), pytest.raises(ArithmeticError, match="6 coefficients"):
        series.motion_series(field, arb(0), [arb(1)], 20)


def test_no_series_is_summed_outside_of_its_disc():
    bounds = Disc(radius=arb(1), state=[arb(1)], start=[arb(1)])
    for q in (arb(1), arb(3), arb(0.5, 1), arb("nan")):
        assert not bounds.remainder(q, 10)[0].is_finite()
    with pytest.raises(NotEnclosed):
        _tube(_field(lambda t, y: [y[0] ** 2], 1), [1.0], -5.0)


@pytest.mark.parametrize(
    "one",
    [
        jnp.sqrt,
        jnp.log,
        lambda x: 1 / x,
        lambda x: x**0.3,
        lambda x: x**-1.5,
        lambda x: jnp.tanh(jnp.log(x)),
        lambda x: jnp.where(x == 0, 1.0, 2.0),
        lambda x: 1 / jnp.tan(x),
        lambda x: jnp.arctan(jnp.log(x)),
        lambda x: jnp.sin(x) / x,
    ],
)
def test_no_disc_reaches_beyond_the_domain_of_a_function(one):
    field = _field(lambda t, y: [one(y[0])], 1)
    for box in (arb(1e-3, 1e-3), arb(1e-3, 2e-3)):
        assert _disc(field, box) is None
    # All functions are analytic but at 0: from 1 the disc does not contain a time of being there.
    found = _disc(field, arb(1))
    assert found is not None
    bounds, coefficients = found
    angles = np.exp(1j * np.linspace(0, np.pi, 50))
    times = float(bounds.radius) * np.linspace(0, 1, 50)[:, None] * angles
    there = np.polynomial.polynomial.polyval(times, [float(x) for x in coefficients])
    assert np.abs(there).min() > float(bounds.state[0])


def test_the_inverse_tangent_has_no_bound_across_its_cut():
    near = arb(0, 0.1)
    assert not COMPLEX.atan(acb(near, arb(1.5) + near)).is_finite()
    with precision(BITS):
        for z in (0.5 + 0.7j, -3.0 + 0.2j):
            found = COMPLEX.atan(acb(arb(z.real), arb(z.imag)))
            exact = np.arctan(z)
            assert abs(complex(found) - exact) < 1e-14


def _disc(field, box, order=40):
    with precision(BITS, order):
        coefficients = series.motion_series(field, arb(0), [box.mid()], order)
        found = disc(About(field, arb(0), coefficients, [box], [1.0]), None, 10.0)
    return None if found is None else (found[0], coefficients[0])


def test_what_a_series_leaves_out_is_within_the_bound_and_not_much_less():
    # y = 1 / (1 - t), whose series has the coefficients 1, from each start of a box.
    field, order, width = _field(lambda t, y: [y[0] ** 2], 1), 40, 1e-7
    found = _disc(field, arb(1, width), order)
    assert found is not None
    bounds = found[0]
    radius = float(bounds.radius)
    assert 0.25 < radius < 1
    for part in (0.2, 0.5, 0.9):
        h = part * radius
        exact = h ** (order + 1) / (1 - h)  # of the motion from 1, and of its derivative (1 - h)^-2
        slope = (order + 2) * exact + exact * h / (1 - h)
        assert exact < float(bounds.remainder(arb(part), order)[0])
        (row,) = bounds.left_out_of_slopes(arb(part), order)
        assert slope < float(row[0]) < 1e6 * slope * radius ** -(order + 1)


@pytest.mark.parametrize("one", [jnp.sqrt, jnp.log, lambda x: 1 / x, lambda x: jnp.sin(x) / x])
def test_a_start_at_a_singularity_is_refused(one):
    with pytest.raises(NotEnclosed, match="singularity"):
        _tube(_field(lambda t, y: [one(y[0])], 1), [0.0], 1.0)


def test_a_motion_into_a_singularity_is_refused():
    # y = sqrt(1 - 2 t).
    field = _field(lambda t, y: [-1 / y[0]], 1)
    assert _contains(_tube(field, [1.0], 0.375).box[0], mpmath.mpf(0.5))
    for span in (0.5, 0.75):
        with pytest.raises(NotEnclosed, match=r"singularity|too wide"):
            _tube(field, [1.0], span, digits=10, slope_digits=10, bits=80)


def test_errors_turn_with_the_motion():
    # In entries of sizes 1 and 30 a turn multiplies intervals by 30 in each step.
    field = _field(lambda t, y: [y[1], -900 * y[0]], 2)
    found = _tube(field, [1.0, 0.0], 2.0, width=1e-12)
    assert _widest(found.slopes.entries()) < 1e-24
    assert max(float(x.rad()) for x in found.box) < 1e-12 * 31
    assert _widest(found.centre) < 1e-24


def test_too_few_bits_widen_the_tube_and_do_not_lose_the_motion():
    field = _field(lambda t, y: [y[1], -y[0]], 2)
    with mpmath.workdps(REFERENCE_DIGITS):
        exact = [mpmath.cos(3), -mpmath.sin(3)]
        for bits in (12, 20, 53):
            try:
                found = _tube(field, [1.0, 0.0], 3.0, bits=bits)
            except NotEnclosed:
                assert bits < 20
            else:
                assert _all_contained(found.box, exact)
                assert _widest(found.box) > 2.0**-bits
