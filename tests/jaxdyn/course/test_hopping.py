"""Motions with corners that repeat: the hopping cylinder against closed forms, other chains."""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, gap
from scipy.integrate import quad
from scipy.optimize import brentq

import jaxdyn
import orbits
from jaxdyn import drawing, scenes
from jaxdyn.analysis import energy
from jaxdyn.course import eccentric_cylinder as cylinder
from jaxdyn.effects import UniformGravity
from jaxdyn.integrate import events, phases
from jaxdyn.scenes.corners import phases_of
from jaxdyn.scenes.cylinders import NormalForce
from orbits.hybrid.equations import ChainEquations
from orbits.hybrid.search import ReturnToStart

G = 9.81
LEVEL = scenes.cylinder_on_ramp(slope=0.0)


@pytest.fixture(scope="module")
def slides():
    return cylinder.hop(LEVEL)


@pytest.fixture(scope="module")
def rolls():
    return cylinder.hop(LEVEL, rolls=True)


def corner(turns):
    """a of tan a = pi n + a, by bisection."""
    found: Any = brentq(
        lambda a: math.sin(a) - (math.pi * turns + a) * math.cos(a), 0.1, 1.57, xtol=1e-15
    )
    return found


def contact_time(mass_at, a, spin, d=0.5, m=1.0):
    """From corner to corner by energy: the inertia at a turn, the spin at the corner."""
    total = 0.5 * mass_at(a) * spin**2 + m * G * d * math.cos(a)

    def slowness(psi):
        return math.sqrt(mass_at(psi) / (2 * (total - m * G * d * math.cos(psi))))

    return 2 * quad(slowness, a, math.pi, epsabs=1e-14, epsrel=1e-14)[0]


@pytest.mark.slow
@pytest.mark.parametrize("turns", [1, 2])
def test_the_hop_is_that_of_the_closed_form(turns):
    hop = cylinder.hop(LEVEL, turns=turns)
    assert hop.residual <= 1e-12
    a = corner(turns)
    spin = math.sqrt(G / (0.5 * math.cos(a)))
    landing = np.asarray(hop.legs[1].scene.y0)
    reach = 1 + 0.5 * math.cos(a)
    exact = [reach, 2 * math.pi * turns + a, spin * reach, -spin * 0.5 * math.sin(a), spin]
    assert gap(landing[1:], np.array(exact)) < SOLVED
    assert abs(hop.spans[0] + hop.spans[2] - 2 * (math.pi * turns + a) / spin) < SOLVED
    # Without friction the centre of mass goes on as it is; only its height moves with the turn.
    stands = contact_time(lambda psi: 0.4 + (0.5 * math.sin(psi)) ** 2, a, spin)
    assert abs(hop.spans[1] - stands) < SOLVED
    assert abs(cylinder.advance(hop) - spin * reach * hop.period) < 10 * SOLVED


@pytest.mark.slow
def test_it_is_a_motion_of_nature(slides):
    scene = slides.legs[1].scene
    assert cylinder.pull(slides) < SOLVED
    assert slides.smallest(1, NormalForce(scene)) > -SOLVED
    for leg in (0, 2):
        assert slides.smallest(leg, cylinder.Height(scene.system)) > -SOLVED
    chain = slides.trajectory()
    totals = np.concatenate([energy.along(energy.energy, piece) for piece in chain.pieces])
    assert np.ptp(totals) < 10 * SOLVED
    # Landing and leaving: neither speed nor upward acceleration between cylinder and ground.
    fly = slides.legs[0].scene
    for piece in (chain.pieces[1].ys[0], chain.pieces[1].ys[-1]):
        for order in (1, 2):
            assert abs(cylinder.Rises(fly, order).value(0.0, piece)) < 1e-10
        assert abs(scene.system.slip(piece)) < SOLVED


@pytest.mark.slow
def test_the_chain_of_phases_follows_it(slides):
    """`simulate_phases` finds its own corners, with landings that keep no normal speed."""
    real = phases_of(slides.legs[1].scene)
    for lower in (0.0, 1e-12, 1e-9, 1e-7):
        start = jnp.asarray(slides.y0).at[1].add(-lower)
        flight = phases.simulate_phases(real, "fly", start, slides.spans[:2].sum(), samples=50)
        # The landing grazes: it is early by as much as the cube root, and little is lost.
        assert flight.names[0] == "fly"
        assert abs(flight.times[0] - slides.spans[0]) < 1e-3 + 2 * np.cbrt(lower)
        assert gap(flight.y[1:], slides.legs[2].scene.y0[1:]) < 1e-8 + 10 * lower
        for piece in flight.pieces:
            height = jax.vmap(piece.scene.system.height)(piece.ys)
            assert (height > -1e-11).all()


@pytest.mark.slow
def test_where_it_rolls_the_ground_has_to_pull(rolls, slides):
    a, spin = corner(1), math.sqrt(G / (0.5 * math.cos(corner(1))))
    stands = contact_time(lambda psi: 0.4 + 1.25 + math.cos(psi), a, spin)
    assert rolls.residual <= 1e-12
    assert abs(rolls.spans[1] - stands) < SOLVED
    assert abs(rolls.spans[0] - slides.spans[0]) < SOLVED
    assert abs(cylinder.advance(rolls) - 4 * math.pi) < 10 * SOLVED  # two turns of the rim
    # N = m (g + y'') at the corner, where alpha A = m d sin psi (g + R w^2).
    heavy = cylinder.hop(scenes.cylinder_on_ramp(slope=0.0, inertia=400.0), rolls=True)
    for hop, inertia in ((rolls, 0.4), (heavy, 400.0)):
        alpha = 0.5 * math.sin(a) * (G + spin**2) / (inertia + 1.25 + math.cos(a))
        assert abs(cylinder.pull(hop) - 0.5 * math.sin(a) * alpha / G) < 1e-10


@pytest.mark.slow
def test_numbers_of_the_cylinder_do_not_matter_for_its_corner():
    other = scenes.cylinder_on_ramp(slope=0.0, m=3.0, r=0.4, d=0.1, inertia=0.2, g=1.62)
    hop = cylinder.hop(other)
    landing = hop.legs[1].scene.y0
    assert abs(float(landing[2]) - 2 * math.pi - corner(1)) < SOLVED
    assert abs(float(landing[5]) - math.sqrt(1.62 / (0.1 * math.cos(corner(1))))) < SOLVED


@pytest.mark.slow
@pytest.mark.parametrize("inertia", [0.4, 1e-5, 3e-6])
def test_a_cylinder_whose_mass_is_near_its_centre_hops_too(inertia):
    hop = cylinder.hop(scenes.cylinder_on_ramp(slope=0.0, m=100.0, r=10.0, d=3.0, inertia=inertia))
    a = corner(1)
    spin = math.sqrt(G / (3.0 * math.cos(a)))
    stands = contact_time(lambda psi: inertia + 100 * (3 * math.sin(psi)) ** 2, a, spin, 3.0, 100.0)
    assert hop.residual < 1e-11
    assert abs(hop.spans[1] - stands) < 1e-10


@pytest.mark.slow
def test_a_hop_that_rounding_hides_is_none():
    with pytest.raises(orbits.SearchError, match=r"inertia is below .* m d\^2.*Take a larger"):
        cylinder.hop(scenes.cylinder_on_ramp(slope=0.0, inertia=1e-13))


@pytest.mark.slow
def test_a_picture(slides, tmp_path):
    drawing.trajectory(slides.trajectory(), tmp_path / "hop.png", title="A hop without loss")
    assert (tmp_path / "hop.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: cylinder.hop(scenes.cylinder_on_ramp()), r"slope: expected 0, level .* gains"),
        (
            lambda: cylinder.hop(scenes.cylinder_on_ramp(slope=0.0, d=0.0)),
            "d: expected > 0.*does not hop",
        ),
        (lambda: cylinder.hop(LEVEL, turns=0), "turns: expected a whole number.*enter the ground"),
        (lambda: cylinder.hop(scenes.pendulum()), "scene: expected a cylinder on a ramp"),
        (
            lambda: cylinder.hop(LEVEL.without(UniformGravity) + UniformGravity(-1.0)),
            "scene: expected gravity downwards",
        ),
    ],
)
def test_hops_that_make_no_sense_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def _bounced(t, y):
    del t
    return y * jnp.array([1.0, 1.0, 1.0, -1.0])


BALL = scenes.cannonball(g=10.0)
LANDS, TOP = events.Reaches(1, 0.0), events.Reaches(3, 0.0)


@pytest.mark.slow
def test_a_ball_that_bounces_without_loss():
    legs = [orbits.Leg(BALL, (LANDS,), _bounced), orbits.Leg(BALL, (TOP, events.Reaches(1, 5.0)))]
    found = orbits.find_hybrid(legs, [0.3, 4.0, 0.0, 0.0], [0.7, 1.2])
    assert abs(found.period - 2.0) < SOLVED
    assert gap(found.y0, [0.3, 5.0, 0.0, 0.0]) < SOLVED
    chain = found.trajectory(5)
    assert chain.times == pytest.approx((1.0, 2.0), abs=SOLVED)
    assert gap(chain.y, found.y0) < SOLVED


def test_a_chain_that_passes_a_bound_is_not_found():
    """The ball falls to 0; it keeps to a floor there or deeper, not to a higher one."""

    def found(level):
        floor = events.Reaches(1, level)
        falls = orbits.Leg(BALL, (LANDS,), _bounced, bounds=(floor,))
        rises = orbits.Leg(BALL, (TOP, events.Reaches(1, 5.0)))
        guess = [0.3, 4.0, 0.0, 0.0], [0.7, 1.2]
        return orbits.find_hybrid([falls, rises], *guess, throw=False), floor

    assert found(-1.0)[0].ok
    assert found(0.0)[0].ok
    low, floor = found(0.5)
    assert not low.ok
    assert low.outcome == orbits.Outcome.BOUND_PASSED
    assert "a leg is on the far side of one of its bounds on the way" in low.message
    assert low.message.endswith("On the way legs[0].bounds[0] goes down to -0.5.")
    assert abs(low.smallest(0, floor) + 0.5) < SOLVED


#: A table that goes up and down once in a time of 1, and a ball that loses speed on it.
AMPLITUDE, TURN, KEPT = 0.2, 2 * math.pi, 0.6


def _table(phase):
    return AMPLITUDE * jnp.sin(phase), AMPLITUDE * TURN * jnp.cos(phase)


def _off_the_table(y, phase):
    """The height and the velocity of a ball after it has met the table."""
    speed = _table(phase)[1]
    return y.at[1].set(speed - KEPT * (y[1] - speed))


class OnTable(events.Event):
    """The height above the table, whose phase is an entry of the state or a function of time."""

    in_state: bool = eqx.field(static=True)

    def value(self, t, y):
        return y[0] - _table(y[2] if self.in_state else TURN * t)[0]


def _met(t, y):
    del t
    return _off_the_table(y, y[2])


def _met_in_time(t, y):
    return _off_the_table(y, TURN * t)


def _turned_once(end, start):
    return (end - start).at[2].add(-2 * math.pi)


def test_a_ball_on_a_table_that_goes_up_and_down_with_its_phase_in_the_state():
    scene = jaxdyn.ode(lambda t, y: [y[1], -G + 0.0 * y[0], TURN], [0.0, 5.0, 1.0], 1.0)
    leg = orbits.Leg(scene, (OnTable(True),), _met)
    found = orbits.find_hybrid([leg], [0.1, 5.0, 1.0], [0.9], closes=_turned_once)
    # It meets the table where that rises at g T / 2 (1 - e) / (1 + e), and leaves at g T / 2.
    phase = math.acos(G / 2 * (1 - KEPT) / (1 + KEPT) / (AMPLITUDE * TURN))
    assert abs(found.period - 1.0) < SOLVED
    assert gap(found.y0, [AMPLITUDE * math.sin(phase), G / 2, phase]) < SOLVED


@pytest.mark.parametrize(
    ("leg", "name"),
    [
        (lambda scene: orbits.Leg(scene, (OnTable(False),), _met), r"ends\[0\]"),
        (lambda scene: orbits.Leg(scene, (OnTable(True),), _met_in_time), "change"),
        (lambda scene: orbits.Leg(scene, (), _met, bounds=(OnTable(False),)), r"bounds\[0\]"),
        (lambda scene: orbits.Leg(scene, (events.Every(1.0),), _met), r"ends\[0\]"),
    ],
)
def test_what_depends_on_time_is_refused(leg, name):
    scene = jaxdyn.ode(lambda t, y: [y[1], -G + 0.0 * y[0], TURN], [0.0, 5.0, 1.0], 1.0)
    message = rf"^legs\[0\]\.{name}: expected a function of the state alone, got one that depends"
    with pytest.raises(ValueError, match=message):
        orbits.find_hybrid([leg(scene)], [0.1, 5.0, 1.0], [0.9])


def test_the_derivatives_of_a_chain_are_those_of_differences():
    legs = (orbits.Leg(BALL, (LANDS,), _bounced), orbits.Leg(BALL, (TOP,)))
    x = np.array([0.1, 3.0, 0.2, 0.4, 0.7, 0.8])

    def value(x):
        return ChainEquations(legs, ReturnToStart(BALL)).linearize(x, 1e-13)[0]

    step = 1e-3
    columns = [(value(x + step * e) - value(x - step * e)) / (2 * step) for e in np.eye(6)]
    # A ball's fall is quadratic in all of them: central differences are exact.
    assert (
        gap(ChainEquations(legs, ReturnToStart(BALL)).linearize(x, 1e-13)[1], np.stack(columns, -1))
        < 1e-10
    )


def test_another_tolerance_compiles_nothing():
    traced = []

    def counted(t, y):
        traced.append(t)
        return _bounced(t, y)

    legs = (orbits.Leg(BALL, (LANDS,), counted),)
    x = np.array([0.1, 3.0, 0.2, 0.4, 0.7])
    chain = ChainEquations(legs, ReturnToStart(BALL))
    chain.linearize(x, 1e-13)
    count = len(traced)
    chain.linearize(x + 0.1, 1e-9)
    assert len(traced) == count > 0


def test_searches_that_fail_say_why():
    # Thrown up it never comes down to a floor that is too high.
    high = orbits.Leg(BALL, (events.Reaches(1, 9.0), events.Reaches(3, 5.0)), _bounced)
    found = orbits.find_hybrid([high], [0.0, 1.0, 0.0, 1.0], [0.5], throw=False)
    assert not found.ok
    assert found.outcome in (orbits.Outcome.OPEN_CHAIN, orbits.Outcome.TRIVIAL)
    falls = orbits.Leg(scenes.power_law(n=-2.0), (events.Reaches(3, 0.0),), _bounced)
    into = orbits.find_hybrid([falls], [1.0, 0.0, 0.0, 0.0], [2.0], throw=False)
    assert into.outcome == orbits.Outcome.COLLISION
    assert "legs[0]: The step size fell below" in into.message
    ends = (LANDS, events.Reaches(3, -1e-3))
    short = orbits.Leg(BALL, ends, _bounced)
    none = orbits.find_hybrid([short], [0.0, 1.0, 0.0, 0.0], [0.5], throw=False)
    assert none.outcome == orbits.Outcome.TRIVIAL
    assert none.message.endswith("legs[0] has shrunk to a span of 0.01.")
    with pytest.raises(orbits.SearchError, match=r"of the chain of legs|trivial"):
        orbits.find_hybrid([high], [0.0, 1.0, 0.0, 1.0], [0.5])
    one = orbits.find_hybrid(
        [orbits.Leg(BALL, (LANDS,), _bounced), orbits.Leg(BALL, (TOP, events.Reaches(1, 5.0)))],
        [0.3, 4.0, 0.0, 0.0],
        [0.1, 3.0],
        max_iterations=1,
        throw=False,
    )
    assert one.outcome == orbits.Outcome.ITERATION_LIMIT
    assert "Raise max_iterations" in one.message


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: orbits.find_hybrid([], [0.0], []), "legs: expected at least one"),
        (lambda: orbits.find_hybrid([BALL], np.zeros(4), [1.0]), r"legs\[0\]: expected a Leg"),
        (
            lambda: orbits.find_hybrid([orbits.Leg(scenes.shaken_pendulum(), ())], [0, 0], [1.0]),
            r"legs\[0\]: expected a scene that does not depend on time",
        ),
        (lambda: orbits.find_hybrid([orbits.Leg(BALL, ())], [0.0], [1.0]), "y0: expected a state"),
        (
            lambda: orbits.find_hybrid([orbits.Leg(BALL, ())], np.zeros(4), [-1.0]),
            "spans: expected a time > 0 for each of 1 legs",
        ),
        (
            lambda: orbits.find_hybrid([orbits.Leg(BALL, ())], np.zeros(4), [1.0], goal=0.0),
            "goal: expected > 0",
        ),
        (
            lambda: orbits.find_hybrid([orbits.Leg(BALL, ())], np.zeros(4), [1], max_iterations=-1),
            "max_iterations: expected a whole number, at least 0",
        ),
        (
            lambda: orbits.find_hybrid([orbits.Leg(BALL, LANDS)], np.zeros(4), [1.0]),
            r"legs\[0\]\.ends: expected a tuple of events, got Reaches",
        ),
        (
            lambda: orbits.find_hybrid([orbits.Leg(BALL, (), bounds=LANDS)], np.zeros(4), [1.0]),
            r"legs\[0\]\.bounds: expected a tuple of events, got Reaches",
        ),
        (
            lambda: orbits.find_hybrid(
                [orbits.Leg(scenes.cannonball(m=-1.0), (LANDS,))], np.zeros(4), [1.0]
            ),
            "expected >= 0",
        ),
    ],
)
def test_chains_that_make_no_sense_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.01, 20.0])
def test_small_and_large_cylinders_hop(size):
    scene = scenes.cylinder_on_ramp(slope=0.0, r=size, d=0.4 * size, inertia=0.3 * size**2)
    hop = cylinder.hop(scene)
    assert abs(float(hop.legs[1].scene.y0[2]) - 2 * math.pi - corner(1)) < SOLVED
