"""Orbits from Hopf points: their size, their period, and the family that they begin."""

import jax.numpy as jnp
import numpy as np
import odes
import pytest
from scipy.integrate import solve_ivp

import jaxdyn
import orbits
from benchmarks.published import hodgkin_huxley

#: Where the equilibria of Lorenz's equations lose their stability: sigma (sigma + beta + 3) /
#: (sigma - beta - 1) (Sparrow, The Lorenz Equations, 1982).
LORENZ_HOPF = 470 / 19


def lorenz(rho):
    params = {"sigma": 10.0, "rho": rho, "beta": 8 / 3}
    return jaxdyn.ode(odes.lorenz, [8.0, 8.0, 24.0], 1.0, params=params)


def stuart_landau(a):
    params = (a, 0.5, 2.0)  # (a, b, w)
    return jaxdyn.ode(odes.stuart_landau, [0.0, 0.0], 1.0, params=params)


@pytest.mark.parametrize("amplitude", [1e-3, 0.3, -0.3])
def test_orbits_of_the_normal_form_have_the_radius_of_their_parameter(amplitude):
    equilibria = jaxdyn.continue_equilibria(stuart_landau, -1.0, [0.0, 0.0], step=0.3, members=8)
    (point,) = equilibria.special
    orbit, a = orbits.from_hopf(equilibria, point, amplitude=amplitude)
    # A circle of radius sqrt(a), whose period is 2 pi / (w + a b).
    assert abs(orbit.y0 @ orbit.y0 - a) < 1e-12
    assert abs(np.abs(orbit.y0).max() - abs(amplitude)) < 1e-12
    assert abs(orbit.period - 2 * np.pi / (2.0 + 0.5 * a)) < 1e-11
    assert orbits.stability(orbit).verdict == "stable"


def beside(t, y, params):
    return odes.stuart_landau(t, y - CENTRE, params)


#: An equilibrium whose entries are small, and say nothing about the size of orbits around it.
CENTRE = np.array([1e-4, 2e-5])


@pytest.mark.slow
def test_orbits_around_an_equilibrium_near_the_origin_are_large_enough_to_be_followed():
    def make(a):
        return jaxdyn.ode(beside, CENTRE, 1.0, params=(a, 0.5, 2.0))

    equilibria = jaxdyn.continue_equilibria(make, -1.0, CENTRE, step=0.3, members=8)
    orbit, a = orbits.from_hopf(equilibria, equilibria.special[0])
    family = orbits.continue_family(orbit, make, a, within=(-1.0, 0.5))
    assert family.end == "the bounds (-1.0, 0.5)"
    values = np.array([member.parameter for member in family.members])
    radii = [np.linalg.norm(np.asarray(member.orbit.y0) - CENTRE) for member in family.members]
    assert np.allclose(np.square(radii), values, rtol=1e-9, atol=1e-14)


def subcritical(sign, scale):
    """r' = r (a + r^2), or with a sign of -1 backwards in a: circles of radius sqrt(-a)."""

    def rate(t, y, a):
        x = y / scale
        growth = sign * a + x @ x
        return scale * jnp.array([growth * x[0] - 2 * x[1], growth * x[1] + 2 * x[0]])

    return lambda a: jaxdyn.ode(rate, [0.0, 0.0], 1.0, params=a)


@pytest.mark.parametrize(("sign", "scale"), [(1, 1.0), (-1, 1.0), (1, 1e-6)])
@pytest.mark.parametrize("step", [pytest.param(0.002, marks=pytest.mark.slow), 0.1])
def test_a_family_from_a_hopf_point_leads_away_from_it(sign, scale, step):
    make = subcritical(sign, scale)
    equilibria = jaxdyn.continue_equilibria(make, -1.0, [0.0, 0.0], step=0.3, members=8)
    (point,) = equilibria.special
    orbit, a = orbits.from_hopf(equilibria, point, amplitude=0.1 * scale)
    family = orbits.continue_family(orbit, make, a, step=step, members=4)
    radii = [np.linalg.norm(np.asarray(x.orbit.y0)) / scale for x in family.members]
    assert len(radii) == 4
    assert (np.diff(radii) > 0).all()
    assert np.allclose(np.square(radii), -sign * family.parameters, rtol=1e-9)
    # Either way can be asked for.
    back = orbits.continue_family(orbit, make, a, step=step, members=2, down=sign < 0)
    assert back.end == "an equilibrium, to which the orbits shrink" or (
        np.linalg.norm(np.asarray(back.members[1].orbit.y0)) < radii[0] * scale
    )


def test_misuse_of_a_hopf_point_is_refused():
    equilibria = jaxdyn.continue_equilibria(stuart_landau, -1.0, [0.0, 0.0], step=0.3, members=8)
    (point,) = equilibria.special
    with pytest.raises(ValueError, match="point: expected a Hopf point"):
        orbits.from_hopf(equilibria, equilibria.members[0])
    for wrong in (0.0, np.nan):
        with pytest.raises(ValueError, match="amplitude"):
            orbits.from_hopf(equilibria, point, amplitude=wrong)


def brusselator(b):
    return jaxdyn.ode(odes.brusselator, [1.0, 1.5], 6.0, params=(1.0, b))


@pytest.mark.slow
def test_an_amplitude_in_other_units_than_the_state_is_refused():
    """So far away that a motion that hardly moves closes to its size."""
    equilibria = jaxdyn.continue_equilibria(brusselator, 1.9, [1.0, 1.9], within=(1.9, 2.1))
    with pytest.raises(orbits.SearchError, match="units of the state"):
        orbits.from_hopf(equilibria, equilibria.special[0], amplitude=1e8)


@pytest.mark.slow
def test_lorenz_orbits_are_followed_from_their_hopf_point_towards_the_homoclinic(tmp_path):
    start = [7.1, 7.1, 19.0]
    equilibria = jaxdyn.continue_equilibria(lorenz, 20.0, start, step=1.0, members=8)
    (point,) = equilibria.special
    assert abs(point.parameter - LORENZ_HOPF) < 1e-12
    assert point.criticality == "subcritical"
    orbit, rho = orbits.from_hopf(equilibria, point, amplitude=0.1)
    assert rho < LORENZ_HOPF
    options = {"step": 0.2, "down": True, "path": tmp_path / "family.jsonl"}
    family = orbits.continue_family(orbit, lorenz, rho, members=40, **options)
    # Errors grow along the way: it is cut again, and its file says so.
    assert family.members[-1].point.equations.segments > family.equations.segments
    (again,) = orbits.families.load(options["path"], lorenz).orbits
    np.testing.assert_array_equal(again.parameters, family.parameters)
    np.testing.assert_array_equal(again.members[-1].point.x, family.members[-1].point.x)
    longer = orbits.continue_family(orbit, lorenz, rho, members=41, **options)
    np.testing.assert_array_equal(longer.parameters[:40], family.parameters)
    # At the homoclinic orbit rho no longer changes but by rounding.
    assert (np.diff(family.parameters) < 1e-13).all()
    assert (np.diff(family.periods) > 0).all()
    # Where the orbits end on the saddle at the origin: Sparrow (1982), The Lorenz Equations.
    assert abs(family.parameters[-1] - 13.9265574075) < 1e-9
    assert family.periods[-1] > 10
    before = [member for member in family.members if member.parameter > 14]
    assert {member.stability.verdict for member in before} == {"unstable"}
    member = next(x for x in before[::-1] if x.parameter > 14.4)  # beyond, errors grow 100 times
    params = {"sigma": 10.0, "rho": member.parameter, "beta": 8 / 3}
    flow = solve_ivp(
        lambda t, y: odes.lorenz(t, y, params),
        (0.0, member.orbit.period),
        np.asarray(member.orbit.y0),
        method="DOP853",
        rtol=1e-13,
        atol=1e-13,
    )
    assert np.abs(flow.y[:, -1] - member.orbit.y0).max() < 1e-9


def axon_at(current):
    return jaxdyn.ode(hodgkin_huxley, [0.0, 0.05, 0.6, 0.32], 20.0, params=current)


@pytest.mark.slow
def test_the_cycles_of_an_axon_have_their_folds():
    start = [0.0, 0.05, 0.6, 0.32]
    equilibria = jaxdyn.continue_equilibria(axon_at, 0.0, start, members=100)
    first, last = equilibria.special[:2]
    # Rinzel, Miller, Biol. Cybern. 37 (1980) 1; Hassard, J. Theor. Biol. 71 (1978) 401.
    assert abs(first.parameter - 9.7796) < 1e-4
    assert abs(last.parameter - 154.527) < 1e-3
    orbit, current = orbits.from_hopf(equilibria, first)
    assert current < first.parameter  # subcritical
    orbit, current = orbits.from_hopf(equilibria, last)
    family = orbits.continue_family(
        orbit, axon_at, current, step=0.1, members=100, down=True, within=(0, 160)
    )
    folds = [x.parameter for x in family.special if x.kind == orbits.Kind.FOLD]
    np.testing.assert_allclose(folds, [6.26, 7.92, 7.85], atol=6e-3)
    # From one Hopf point to the other, in more segments where it is unstable, by factors of 1e8.
    assert family.special[-1].kind == orbits.Kind.REST
    assert abs(family.special[-1].parameter - first.parameter) < 1e-4
    assert family.members[-1].point.equations.segments > family.equations.segments
