"""Connections of periodic orbits: published orbits, SciPy's motions, and what is refused."""

import math

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.analysis.energy import energy
from jaxdyn.integrate.events import Reaches, When
from orbits.closing.sizes import sizes

#: The comet Oterma's energy in the problem of Sun and Jupiter, and where the Lyapunov orbits of L1
#: and L2 cross the axis: Wilczak & Zgliczynski (2003), Commun. Math. Phys. 234, 37, who prove that
#: they are connected. Their Jacobi constant 3.03 has the term mu (1 - mu).
MU, C = 0.0009537, 3.03 - 0.0009537 * (1 - 0.0009537)
NEAR_L1, NEAR_L2 = 0.9208034913207400196, 1.081929486841799903
#: The second point of their motion from L1 to L2, which passes Jupiter three times (section 6.1).
CONNECTING = 0.921005737890425169, 0.0005205932817646883714
JUPITER = Reaches(0, 1 - MU)


def speed(x, jacobi=C):
    r1, r2 = abs(x + MU), abs(x - 1 + MU)
    return math.sqrt(x * x + 2 * (1 - MU) / r1 + 2 * MU / r2 - jacobi)


def lyapunov(x, vy, period, jacobi=C):
    scene = scenes.restricted_three_body(mu=MU, x=x, vy=vy)
    return orbits.find(scene, scene.y0, period, hold=[orbits.Energy(-jacobi / 2), "y"])


@pytest.fixture(scope="module")
def pair():
    return lyapunov(NEAR_L1, speed(NEAR_L1), 3.08), lyapunov(NEAR_L2, -speed(NEAR_L2), 3.31)


@pytest.fixture(scope="module")
def connection(pair):
    return orbits.connect(*pair, until=JUPITER, branch="+-", segments=12)


@pytest.mark.slow
def test_orbits_are_where_they_were_proved_to_be(pair):
    for orbit, x in zip(pair, (NEAR_L1, NEAR_L2), strict=True):
        np.testing.assert_allclose(orbit.y0[:3], [x, 0, 0], rtol=0, atol=2e-14)


@pytest.mark.slow
def test_one_motion_leads_from_one_orbit_to_the_other(pair, connection):
    assert connection.ok
    assert connection.residual < 1e-12
    assert connection.error <= 1e-8
    for i, (orbit, end) in enumerate(zip(pair, (0, -1), strict=True)):
        there = jaxdyn.solve(orbit.scene, connection.phases[i], rtol=1e-13).y1
        np.testing.assert_allclose(connection.limits[i], there, rtol=0, atol=1e-9)
        off = (connection.states[end] - connection.limits[i]) / sizes(orbit.scene)
        off = np.linalg.norm(off)
        assert abs(off - connection.step_off[i]) < 2e-8
    levels = [float(energy(connection.scene, 0.0, jnp.asarray(y))) for y in connection.states]
    # The linear ends are off the level to second order.
    np.testing.assert_allclose(levels, -C / 2, rtol=0, atol=2e-8)
    assert np.ptp(levels) < 1e-13


def rate(t, s):
    x, y, vx, vy = s
    a, b = (1 - MU) / math.hypot(x + MU, y) ** 3, MU / math.hypot(x - 1 + MU, y) ** 3
    ax = 2 * vy + x - a * (x + MU) - b * (x - 1 + MU)
    return [vx, vy, ax, y - 2 * vx - (a + b) * y]


@pytest.mark.slow
def test_scipy_goes_both_ways_from_the_middle(connection):
    middle = int(np.argmin(np.abs(connection.states[:, 0] - 1 + MU)))
    t, y = connection.ts[middle], connection.states[middle]
    for end in (0, -1):
        run = solve_ivp(rate, (t, connection.ts[end]), y, "DOP853", rtol=1e-13, atol=1e-14)
        # Towards either orbit errors of 1e-14 grow, but by less than its multiplier squared.
        np.testing.assert_allclose(run.y[:, -1], connection.states[end], rtol=0, atol=1e-8)


def kinetic(t, q, v):
    return 0.5 * (v[0] ** 2 + v[1] ** 2)


def potential(t, q):
    """A rod that balances at theta = 0, and a mass on a spring; when it moves, they are coupled."""
    return jnp.cos(q[0]) + q[1] ** 2 + 0.1 * q[1] * jnp.sin(q[0]) ** 2


def pushed(t, y):
    theta, x, p, v = y
    return [p, v, np.sin(theta) - 0.1 * x * np.sin(2 * theta), -2 * x - 0.1 * np.sin(theta) ** 2]


@pytest.mark.slow
def test_a_motion_that_goes_round_ends_a_turn_later():
    names = [("theta", "rad"), ("x", "m")]
    scene = jaxdyn.lagrangian((kinetic, potential), [0.0, 0.3], [0.0, 0.0], names=names)
    balanced = orbits.find(scene, period=2 * math.pi / math.sqrt(2))
    found = orbits.connect(
        balanced, balanced, until=When(lambda t, y: jnp.cos(y[0] / 2)), strands=24, time=40.0
    )
    assert found.ok
    middle = int(np.argmin(np.abs(found.states[:, 0] - math.pi)))
    t, y = found.ts[middle], found.states[middle]
    run = solve_ivp(pushed, (t, found.ts[-1]), y, "DOP853", rtol=1e-13, atol=1e-14)
    assert abs(run.y[0, -1] - 2 * math.pi) < 1e-3
    np.testing.assert_allclose(run.y[:, -1], found.states[-1], rtol=0, atol=1e-8)
    # Reversed in time and mirrored, it is the same motion: at half a turn the mass rests.
    np.testing.assert_allclose(y[[0, 3]], [math.pi, 0.0], rtol=0, atol=1e-10)


@pytest.mark.long
def test_the_published_motion_is_found(pair):
    found = orbits.connect(
        *pair, until=JUPITER, branch="+-", segments=20, strands=2000, crossings=2, time=8.0, which=0
    )
    assert found.residual < 1e-12

    def crossings(y, time):
        run = solve_ivp(
            rate, (0, time), y, "DOP853", rtol=1e-13, atol=1e-14, events=lambda t, s: s[1]
        )
        return run.y_events[0][:, [0, 2]]

    x, vx = CONNECTING
    published = crossings([x, 0, vx, math.sqrt(speed(x) ** 2 - vx**2)], 6.0)[1:]
    before = int(np.argmin(np.abs(found.ts - 1.1)))
    ours = crossings(found.states[before], 5.9)
    # At the first point the error of the linear start has not yet shrunk; later the printed digits
    # of the start grow by a factor of 40 from one crossing to the next.
    np.testing.assert_allclose(ours[0], published[0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(ours[1:4], published[1:4], rtol=0, atol=2e-7)


@pytest.mark.slow
def test_numbers_are_printed(connection):
    text = str(connection)
    for part in ("Heteroclinic connection of orbits of restricted_three_body", "residual", "FOUND"):
        assert part in text


def assert_none(found, outcome, said):
    assert found.outcome.name == outcome
    assert said in found.message
    assert math.isnan(found.time)
    assert outcome in str(found)


@pytest.mark.long
def test_strands_that_do_not_meet_are_an_outcome(pair):
    options = {"strands": 12, "segments": 12, "time": 4.5}
    found = orbits.connect(*pair, until=JUPITER, branch="-+", **options)
    assert_none(found, "NO_CROSSING", "other branches")


@pytest.mark.long
def test_fewer_connections_than_asked_for_are_an_outcome(pair):
    options = {"strands": 12, "segments": 12, "which": 99}
    found = orbits.connect(*pair, until=JUPITER, branch="+-", **options)
    assert_none(found, "FEWER", "smaller number")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"crossings": (1, 2, 3)}, "crossings: expected one number"),
        ({"until": None}, "until: expected a section for the connection of orbits"),
        ({"branch": "+"}, "branch: expected"),
        ({"make": lambda p: scenes.lorenz(rho=p), "parameter": 1.0}, "make: expected none"),
        ({"which": -1}, "which: expected"),
    ],
)
def test_misuse_is_refused(pair, options, said):
    with pytest.raises(ValueError, match=said):
        orbits.connect(*pair, **({"until": JUPITER} | options))


@pytest.mark.slow
def test_orbits_that_are_not_connected_are_refused(pair):
    a, b = pair
    # With the speed of the energy that is held: errors of the guess grow by 1400 in a period.
    other = lyapunov(0.9218, speed(0.9218, 3.031), 3.05, jacobi=3.031)
    with pytest.raises(ValueError, match=r"b: expected an orbit with the energy .*Energy\(E\)"):
        orbits.connect(a, other, until=JUPITER)
    with pytest.raises(ValueError, match="one of each"):
        orbits.connect(a, np.asarray(b.y0), until=JUPITER)
    with pytest.raises(ValueError, match="until: expected none for equilibria"):
        orbits.connect(scenes.pendulum().starting([-math.pi, 0.0]), [math.pi, 0.0], until=JUPITER)
    swing = orbits.find(scenes.pendulum(angle=1.0), period=2.2)
    with pytest.raises(ValueError, match="b: expected an orbit of the scene of `a`"):
        orbits.connect(
            orbits.find(scenes.pendulum(angle=1.0, length=1.1), period=2.2),
            swing,
            until=Reaches(0, 0.0),
        )
    with pytest.raises(ValueError, match="three dimensions, or in four"):
        orbits.connect(swing, swing, until=Reaches(0, 0.0))
    driven = orbits.find(scenes.shaken_pendulum(angle=0.0), period=2 * math.pi / 60)
    with pytest.raises(ValueError, match="autonomous"):
        orbits.connect(driven, driven, until=Reaches(0, 0.0))
