"""Families against closed forms: folds, branch points, doublings, tori, conservative families."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from cycles import Bautin, Moebius, Pitchfork, Torus, cycle
from helpers import SOLVED
from scipy.special import ellipk

import jaxdyn
import orbits
from jaxdyn import Status, scenes
from orbits import Kind
from orbits.families import surface
from orbits.families.steps import moved_to
from orbits.shooting.segment import linearize_end


def maker(kind, y0):
    """The scene of each value of a parameter."""
    return lambda a: cycle(kind, a, y0)


def family(kind, a, y0, **options):
    make = maker(kind, y0)
    return orbits.continue_family(orbits.find(make(a)), make, a, **options)


@pytest.fixture(scope="module")
def forks():
    return family(Pitchfork, -0.3, [1.0, 0.0, 0.0], step=0.1, members=8)


@pytest.fixture(scope="module")
def doubled():
    return family(Moebius, -0.2, [1.0, 0.0, 0.0, 0.0], step=0.08, members=6)


@pytest.mark.slow
def test_a_fold_is_nothing_special_and_is_found():
    found = family(Bautin, -0.2, [0.85, 0.0], step=0.05, members=10, down=True)
    radii = np.array([np.linalg.norm(m.orbit.y0) for m in found.members])
    assert np.abs(found.parameters - radii**4 + radii**2).max() < SOLVED
    assert radii.min() < 0.65 < 0.75 < radii.max()  # both sides of the fold
    (fold,) = found.special
    assert fold.kind == Kind.FOLD
    assert abs(fold.parameter + 0.25) < SOLVED  # quadratic in the error of the place
    assert abs(np.linalg.norm(fold.orbit.y0) - np.sqrt(0.5)) < 1e-7
    for m, r in zip(found.members, radii, strict=True):
        exact = np.exp(2 * np.pi * (2 * r**2 - 4 * r**4))
        assert abs(m.stability.nontrivial[0] - exact) < 1e-10


@pytest.mark.slow
def test_a_branch_point_and_the_branch_through_it(forks):
    (point,) = forks.special
    assert point.kind == Kind.BRANCH
    assert abs(point.parameter) < 1e-8
    for amplitude in (0.2, -0.2):
        orbit, a = orbits.switch_branch(forks, point, amplitude=amplitude)
        z = float(orbit.y0[2])
        assert abs(z) > 0.1
        assert abs(z * z - a) < SOLVED
    # At a distance of its own, on either half.
    halves = [orbits.switch_branch(forks, point, opposite=opposite) for opposite in (False, True)]
    heights = [float(half.y0[2]) for half, _ in halves]
    assert heights[0] * heights[1] < 0
    for z, (_, a) in zip(heights, halves, strict=True):
        assert 1e-3 < abs(z) < 0.1
        assert abs(z * z - a) < SOLVED
    orbit, a = orbits.switch_branch(forks, point, amplitude=0.2)
    branch = orbits.continue_family(orbit, maker(Pitchfork, [1.0, 0, 0]), a, members=4, step=0.1)
    heights = np.array([float(m.orbit.y0[2]) for m in branch.members])
    assert np.abs(heights**2 - branch.parameters).max() < SOLVED
    assert {m.stability.verdict for m in branch.members} == {"stable"}


@pytest.mark.slow
@pytest.mark.parametrize("step", [0.1, 0.5])
def test_a_bent_branch_through_its_pitchfork_has_a_branch_point_there(forks, step):
    orbit, a = orbits.switch_branch(forks, forks.special[0], amplitude=0.3)
    make = maker(Pitchfork, [1.0, 0, 0])
    bent = orbits.continue_family(orbit, make, a, members=12, step=step, down=True, within=(-1, 1))
    heights = np.array([float(m.orbit.y0[2]) for m in bent.members])
    assert heights[0] * heights[-1] < 0
    assert np.abs(heights**2 - bent.parameters).max() < SOLVED
    # The parameter is least there, but no multiplier passes through 1: it is no fold.
    (point,) = bent.special
    assert point.kind == Kind.BRANCH
    assert abs(point.parameter) < 1e-12
    straight, _ = orbits.switch_branch(bent, point)
    assert abs(float(straight.y0[2])) < SOLVED


@pytest.mark.slow
def test_a_period_doubling_and_its_branch(doubled):
    (point,) = doubled.special
    assert point.kind == Kind.DOUBLING
    assert abs(point.parameter) < 1e-8
    orbit, a = orbits.switch_branch(doubled, point, amplitude=0.2)
    assert abs(orbit.period - 4 * np.pi) < SOLVED
    u, w = np.asarray(orbit.y0)[2:]
    assert abs(u * u + w * w - a) < SOLVED  # p^2 = a and q = 0
    assert orbits.minimal_period(orbit)[1] == 1


@pytest.mark.slow
def test_a_torus_point():
    found = family(Torus, -0.1, [1.0, 0.0, 0.0, 0.0], step=0.06, members=6)
    (point,) = found.special
    assert point.kind == Kind.TORUS
    assert abs(point.parameter) < 1e-8
    assert abs(np.abs(np.angle(point.stability.nontrivial[0])) - 0.6 * np.pi) < 1e-8


@pytest.mark.slow
def test_a_conservative_family_needs_no_parameter():
    swing = orbits.find(scenes.pendulum(angle=0.5), period=2.0)
    found = orbits.continue_family(swing, members=12, step=0.2)
    assert np.isnan(found.parameters).all()
    exact = 4 / np.sqrt(9.81) * ellipk(0.5 * (1 + found.energies / 9.81))
    assert np.abs(found.periods - exact).max() < 1e-11
    assert (np.diff(found.energies) > 0).all()


def test_a_step_that_comes_near_a_collision_ends_early(monkeypatch):
    limits_of_steps = set()

    def note(*args, limits, **options):
        limits_of_steps.add(limits.max_steps)
        return linearize_end(*args, limits=limits, **options)

    monkeypatch.setattr("orbits.shooting.equations.linearize_end", note)
    swing = orbits.find(scenes.pendulum(angle=0.5))
    found = orbits.continue_family(swing, members=3)
    assert limits_of_steps >= {10 * member.point.steps for member in found.members[:-1]}
    last = found.members[-1]
    assert last.point.steps == last.point.equations(last.point.x, last.orbit.rtol).steps > 50
    # Without time for its steps no orbit is found, and the step of the family is halved.
    point = dataclasses.replace(last.point, steps=1)
    assert surface.OrbitSurface(point.equations, 1e-12, 1e-10).nearest(point.x, near=point) is None


@pytest.mark.slow
def test_it_goes_down_and_stops_at_its_bounds():
    found = family(Pitchfork, -0.3, [1.0, 0.0, 0.0], step=0.1, down=True, within=(-0.6, 0.0))
    assert found.parameters[-2] > -0.6
    assert abs(found.parameters[-1] + 0.6) < 1e-12
    assert "bounds" in found.end


@pytest.mark.slow
def test_a_conservative_family_stops_at_a_bound_on_its_energy():
    swing = orbits.find(scenes.pendulum(angle=0.5), period=2.0)
    bounds = (np.float64(-9.81), jnp.asarray(-7.0))
    found = orbits.continue_family(swing, members=40, step=0.2, energies=bounds)
    assert found.energies[-2] < -7.0
    assert abs(found.energies[-1] + 7.0) < 1e-11
    assert found.end == "the bounds on the energy, (-9.81, -7.0)"
    assert 2 < len(found.members) < 40
    # At the bound itself, against the elliptic integral.
    exact = 4 / np.sqrt(9.81) * ellipk(0.5 * (1 - 7.0 / 9.81))
    assert abs(found.periods[-1] - exact) < SOLVED


def test_it_says_where_it_ends():
    swing = orbits.find(scenes.pendulum(angle=3.0), period=5.0)
    found = orbits.continue_family(swing, members=3)
    assert found.end == "the number of members requested, 3"


def test_a_member_without_multipliers_ends_the_family_and_misuse_surfaces(monkeypatch):
    make = maker(Pitchfork, [1.0, 0.0, 0.0])
    first = orbits.find(make(-0.3))
    calls, judged = [], surface.judge

    def counted(orbit, *known, **options):
        calls.append(options)
        if len(calls) > 1:
            raise ValueError("effect: expected a potential, got none.")
        return judged(orbit, *known, **options)

    monkeypatch.setattr(surface, "judge", counted)
    with pytest.raises(ValueError, match="effect: expected a potential"):
        orbits.continue_family(first, make, -0.3, members=2)
    assert len(calls) == 2

    ended = Status.STEP_LIMIT

    def unknown(orbit, *known, **options):
        calls.append(options)
        linear = judged(orbit, *known, **options)
        return linear if len(calls) == 1 else dataclasses.replace(linear, status=ended)

    monkeypatch.setattr(surface, "judge", unknown)
    calls.clear()
    found = orbits.continue_family(first, make, -0.3, members=2)
    assert len(found.members) == 1
    assert found.end.startswith("no orbit was found beyond")
    found = orbits.continue_family(first, make, -0.3, members=2)
    assert len(found.members) == 1
    assert found.end.endswith(ended.message)


def test_misuse(forks):
    cycle_ = forks.members[0].orbit
    make = maker(Pitchfork, [1.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="parameter: expected make and its value"):
        orbits.continue_family(cycle_, make)
    with pytest.raises(ValueError, match="step: expected > 0"):
        orbits.continue_family(cycle_, make, -0.3, step=0.0)
    with pytest.raises(ValueError, match="members: expected a whole number"):
        orbits.continue_family(cycle_, make, -0.3, members=0)
    with pytest.raises(ValueError, match="down: expected True or False, got 'yes'"):
        orbits.continue_family(cycle_, make, -0.3, down="yes")
    with pytest.raises(ValueError, match="within: expected two bounds"):
        orbits.continue_family(cycle_, make, -0.3, within=(1.0, 0.0))
    with pytest.raises(ValueError, match="energies: expected two bounds"):
        orbits.continue_family(cycle_, make, -0.3, energies=(1.0, 1.0))
    with pytest.raises(ValueError, match="the orbit's scene, with 3 entries, got one with 4 "):
        orbits.continue_family(cycle_, lambda x: scenes.henon_heiles(x=x), 1.0)
    with pytest.raises(ValueError, match="expected a Scene, got float"):
        orbits.continue_family(cycle_, lambda x: x, -0.3)
    with pytest.raises(ValueError, match="a member of a family, got an isolated one"):
        orbits.continue_family(cycle_)
    with pytest.raises(ValueError, match=r"special: expected one of family\.special"):
        orbits.switch_branch(forks, forks.members[0])
    bad = eqx.tree_at(lambda o: o.residual, cycle_, 1.0)
    bad = orbits.Orbit(bad.scene, bad.closing, 1.0, orbits.Outcome.BOUND, 1, 1e-14)
    with pytest.raises(ValueError, match="orbit: expected an orbit that closes"):
        orbits.continue_family(bad, make, -0.3)


@pytest.mark.slow
def test_where_the_motion_fails_collocation_is_named():
    def rate(t, y, mu):
        x, v = y
        return jnp.stack([v, mu * (1 - x**2) * v - x + 1e-3 * jnp.sqrt(0.5 - mu)])

    def make(mu):
        return jaxdyn.ode(rate, [2.0, 0.0], 6.4, params=mu)

    cycle = orbits.find(make(0.4))
    found = orbits.continue_family(cycle, make, 0.4, members=30)
    assert 0.4 < found.members[-1].parameter < 0.5
    assert found.end.startswith("no orbit was found beyond: the motion does not last a period")
    assert found.end.endswith("strategy=orbits.Collocation() the family may go further")


def test_bounds_are_around_the_first_orbit():
    swing = orbits.find(scenes.pendulum(angle=2.0), period=2.7)
    with pytest.raises(ValueError, match=r"within: expected bounds around the period of the orbit"):
        orbits.continue_family(swing, within=(0.1, 0.2))
    with pytest.raises(ValueError, match="within: expected two bounds, the lower one first"):
        orbits.continue_family(swing, within=9.0)  # pyright: ignore[reportArgumentType]


@pytest.mark.slow
def test_a_member_on_another_mesh_is_the_same_orbit():
    """A family that was cut again is searched for special points since before that."""

    def make(mu):
        return jaxdyn.ode(
            lambda t, y, mu: [y[1], mu * (1 - y[0] ** 2) * y[1] - y[0]], [2.0, 0.0], 7.0, params=mu
        )

    def member(mu, period):
        found = orbits.find(make(mu), period=period, strategy=orbits.Collocation())
        return orbits.continue_family(found, make, mu, members=2, down=False).members[0]

    mild, sharp = member(1.0, 6.66), member(6.0, 13.0)
    assert mild.point.x.size < sharp.point.x.size
    fine = surface.OrbitSurface(sharp.point.equations, 1e-12, 1e-10)
    same = moved_to(fine, mild)
    assert same.point.x.size == same.tangent.size == sharp.point.x.size
    np.testing.assert_allclose(same.point.place, mild.point.place, rtol=1e-9, atol=1e-9)
    ends = [(m.tangent / m.point.units)[[0, 1, -2, -1]] for m in (same, mild)]
    cosine = ends[0] @ ends[1] / np.linalg.norm(ends[0]) / np.linalg.norm(ends[1])
    assert cosine == pytest.approx(1.0, abs=1e-6)


@pytest.mark.slow
def test_a_family_at_one_value_of_its_parameter_says_so():
    """Small oscillations of any amplitude, but only without damping."""

    def make(damping):
        return jaxdyn.ode(
            lambda t, y, c: [y[1], -y[0] - y[0] ** 3 - c * y[1]], [1.0, 0.0], 4.0, params=damping
        )

    found = orbits.continue_family(orbits.find(make(0.0)), make, 0.0, members=3)
    assert "the parameter does not change along the family" in found.end
    assert np.ptp(found.periods) > 0.0
