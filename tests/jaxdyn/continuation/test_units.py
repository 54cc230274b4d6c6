"""No unit matters: families of equilibria and curves in two parameters are the same in all units.

Numbers of the units are traced, so that they share programs.
"""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn.continuation import Kind, switch_branch

#: Units of the entries, of the parameters, and of time.
UNITS = [
    ([1e-12, 1e12, 1e-6], [1e12, 1e-6], 1e-12),
    ([1e12, 1e-12, 3e7], [1e-12, 1e9], 1e6),
    ([1e6, 2e6, 1e6], [7e11, 1e-12], 1e12),
]
PLAIN = ([1.0, 1.0, 1.0], [1.0, 1.0], 1.0)
#: How exactly points are located, besides the rounding in another program.
SAME = 1e-10


def lorenz(y, rho, beta):
    return [10 * (y[1] - y[0]), y[0] * (rho - y[2]) - y[1], y[0] * y[1] - beta * y[2]]


def bogdanov_takens(y, p, q):
    """Folds at 4 p = q^2, Hopf points at p = 0, q < 0; the last entry only follows."""
    return [y[1], p + q * y[0] + y[0] ** 2 - y[0] * y[1], y[0] + 1.0 - y[2]]


def cubic(y, p, q):
    return [p + q * y[0] - y[0] ** 3, -y[1] + y[0], -y[2] + 1.0]


def rewritten(rate, units):
    """(p, q) -> the scene of a rate in some units."""
    each, own, time = (np.array(x) for x in units)

    def scaled(t, y, numbers):
        values, each, time = numbers
        return each * jnp.stack(rate(y / each, *values)) / time

    def make(p, q):
        values = jnp.stack([p / own[0], q / own[1]])
        return jaxdyn.ode(scaled, np.zeros(3), time, params=(values, each, time))

    return make


def family(rate, units, start, parameter, within, second, **options):
    each, own, _ = (np.array(x) for x in units)
    make = rewritten(rate, units)

    def of_one(p):
        return make(p, jnp.asarray(second * own[1]))

    bounds = tuple(own[0] * np.array(within))
    start = each * np.array(start)
    return jaxdyn.continue_equilibria(of_one, parameter * own[0], start, within=bounds, **options)


def assert_alike(there, here, units):
    """Two families of the same members and special points, in their units."""
    each, own, time = (np.array(x) for x in units)
    assert len(there.members) == len(here.members)
    assert there.end.split(" (")[0] == here.end.split(" (")[0]
    assert [x.kind for x in there.special] == [x.kind for x in here.special]
    assert [x.verdict for x in there.members] == [x.verdict for x in here.members]
    for one, other in zip(there.special, here.special, strict=True):
        np.testing.assert_allclose(one.state / each, other.state, atol=SAME)
        assert one.parameter / own[0] == pytest.approx(other.parameter, abs=SAME)
        assert one.frequency * time == pytest.approx(other.frequency, abs=SAME, nan_ok=True)
        assert one.criticality == other.criticality
        assert one.residual < 1e-10
        found = one.eigenvalues.values * time
        np.testing.assert_allclose(found, other.eigenvalues.values, atol=1e-7)
    for one, other in zip(there.members, here.members, strict=True):
        np.testing.assert_allclose(one.state / each, other.state, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("units", UNITS)
def test_a_hopf_point(units):
    of = ([7.0, 7.0, 19.0], 20.0, (14, 28), 8 / 3)
    plain, found = (family(lorenz, u, *of) for u in (PLAIN, units))
    assert_alike(found, plain, units)
    (hopf,) = found.special
    assert (hopf.kind, hopf.criticality) == (Kind.HOPF, "subcritical")
    assert hopf.parameter / units[1][0] == pytest.approx(470 / 19, rel=1e-12)


@pytest.mark.sample("units1")
@pytest.mark.parametrize("units", UNITS)
def test_folds(units):
    of = ([-2.5, -2.5, 1.0], -5.0, (-6, 5), 3.0)
    plain, found = (family(cubic, u, *of) for u in (PLAIN, units))
    assert_alike(found, plain, units)
    assert [x.kind for x in found.special] == [Kind.FOLD, Kind.FOLD]
    for one, other in zip(found.special, plain.special, strict=True):
        quadratic = one.coefficient / other.coefficient * one.cubic / abs(one.cubic)
        assert quadratic < 0  # signs do not depend on units


@pytest.mark.slow
@pytest.mark.parametrize("units", UNITS)
def test_a_branch_from_an_equilibrium_at_0(units):
    of = ([0.0, 0.0, 0.0], 0.5, (0, 2), 8 / 3)
    plain, found = (family(lorenz, u, *of) for u in (PLAIN, units))
    assert_alike(found, plain, units)
    (point,) = found.special
    assert point.kind == Kind.BRANCH
    branches = [switch_branch(f, f.special[0], members=6) for f in (plain, found)]
    assert_alike(branches[1], branches[0], units)


@pytest.mark.slow
@pytest.mark.parametrize(
    "units", [UNITS[0], *(pytest.param(x, marks=pytest.mark.slow) for x in UNITS[1:])]
)
def test_curves_with_their_special_points(units):
    each, own, time = (np.array(x) for x in units)
    curves = []
    for numbers in (PLAIN, units):
        rests = family(bogdanov_takens, numbers, [-0.25, 0, 0.75], -0.3, (-1, 1), -1.0)
        hopf = next(x for x in rests.special if x.kind == Kind.HOPF)
        start = (hopf.parameter, -numbers[1][1])
        make = rewritten(bogdanov_takens, numbers)
        curve = jaxdyn.continue_curve(make, hopf, start)
        folds = jaxdyn.continue_curve(make, curve.special[0], kind=Kind.FOLD, members=6)
        curves.append((curve, folds))
    for there, here in zip(curves[1], curves[0], strict=True):
        assert (len(there.members), there.end) == (len(here.members), here.end)
        assert [x.kind for x in there.special] == [x.kind for x in here.special]
        np.testing.assert_allclose(there.parameters / own, here.parameters, atol=1e-6)
        np.testing.assert_allclose(there.states / each, here.states, atol=1e-6)
    (point,) = curves[1][0].special
    assert point.kind == "Bogdanov-Takens point"
    np.testing.assert_allclose(point.parameters / own, 0.0, atol=SAME)
    known = curves[0][0].special[0].normal_form
    # They have the units of 1 / time^2 and 1 / time, and both that of 1 / the length of q.
    ratio = point.normal_form["a"] / point.normal_form["b"] * time
    assert ratio == pytest.approx(known["a"] / known["b"], rel=1e-8)


@pytest.mark.slow
def test_files_go_on_and_are_read_in_any_units(tmp_path):
    units, path = UNITS[0], tmp_path / "run.jsonl"
    of = ([7.0, 7.0, 19.0], 20.0, (14, 28), 8 / 3)
    whole = family(lorenz, units, *of)
    family(lorenz, units, *of, path=path, members=3)
    again = family(lorenz, units, *of, path=path)
    np.testing.assert_array_equal(again.states, whole.states)
    for scale, fits in ((1.0, True), (1.001, False)):
        own = np.array(units[1]) * [scale, 1.0]
        make = rewritten(lorenz, (units[0], own, units[2]))

        def of_one(p, make=make, beta=8 / 3 * own[1]):
            return make(p, jnp.asarray(beta))

        if fits:
            (found,) = jaxdyn.continuation.load(path, of_one)
            np.testing.assert_array_equal(found.states, whole.states)
        else:
            with pytest.raises(ValueError, match="the scenes of the file"):
                jaxdyn.continuation.load(path, of_one)


def test_points_of_earlier_files_have_no_units_and_lead_on():
    plain = family(lorenz, PLAIN, [0.0, 0.0, 0.0], 0.5, (0, 2), 8 / 3)
    point = dataclasses.replace(plain.special[0], units=None)
    x = switch_branch(plain, point, members=3).states[:, 0]
    assert (np.diff(x) > 0).all()


def langford(t, y, p):
    """Equilibria on the z axis; a Hopf point at z = 0.7."""
    x, y, z = y
    turned = [(z - 0.7) * x - 3.5 * y, 3.5 * x + (z - 0.7) * y]
    return jnp.stack([*turned, 0.6 + p * z - z**3 / 3 - (x**2 + y**2) * (1 + z / 4)])


def test_entries_that_are_rounding_give_no_units():
    def make(p):
        return jaxdyn.ode(langford, np.zeros(3), 1.0, params=p)

    # As a numerical solution of the equations returns it: zeros are only nearly 0.
    z = 0.8252778707
    first, second = (
        jaxdyn.continue_equilibria(make, -0.5, [x, y, z], within=(-1, 0), down=True)
        for x, y in ((0.0, 0.0), (2e-19, -3e-21))
    )
    (here,), (there,) = first.special, second.special
    assert here.kind == there.kind == Kind.HOPF
    np.testing.assert_allclose(there.units, here.units, rtol=1e-6)
    np.testing.assert_allclose(there.state, [0.0, 0.0, 0.7], atol=1e-12)


def atmosphere(t, y, forcing):
    """Lorenz-84 without the contrast of land and sea: the only linear terms are on the diagonal."""
    x, u, v = y
    turned = [x * u - 4 * x * v - u, 4 * x * u + x * v - v]
    return jnp.stack([-(u**2) - v**2 - 0.25 * x + 0.25 * forcing, *turned])


def van_der_pol(t, y, mu):
    return jnp.stack([y[1], mu * y[1] - y[0] ** 2 * y[1] - y[0]])


@pytest.mark.parametrize(
    ("rate", "start"),
    [
        (atmosphere, [1e-17, 1e-17, 0.0]),  # each is large beside the other
        (atmosphere, [-3e-20, 2e-17, 1e-17]),
        (atmosphere, [1e-9, 1e-10, -3e-9]),  # as precise as a search is by default
        (van_der_pol, [1e-17, 0.0]),
        (van_der_pol, [1e-9, -1e-10]),
    ],
)
def test_starts_near_0_give_the_units_of_0(rate, start):
    def make(p):
        return jaxdyn.ode(rate, np.zeros(len(start)), 1.0, params=p)

    first, second = (
        jaxdyn.continue_equilibria(make, 0.0, y, within=(-0.5, 1.5))
        for y in (np.zeros(len(start)), start)
    )
    (here,), (there,) = first.special, second.special
    assert here.kind == there.kind == Kind.HOPF
    np.testing.assert_allclose(there.units, here.units, rtol=1e-6)


def hunt(t, y, p):
    """Predators with satiation, who are absent on the first family; p is (capacity, units)."""
    (capacity, (prey, predators)) = p
    x, eaten = y[0], y[0] / prey * y[1] / predators / (1 + 0.5 * y[0] / prey)
    return jnp.stack(
        [x * (1 - x / capacity) - prey * eaten, predators * (eaten - 0.5 * y[1] / predators)]
    )


def test_an_entry_at_0_has_the_size_at_which_it_matters_in_any_unit():
    def sizes(*units):
        def make(capacity):
            return jaxdyn.ode(hunt, np.zeros(2), 1.0, params=(capacity, units))

        plain = jaxdyn.continue_equilibria(make, 0.5 * units[0], [0.5 * units[0], 0.0], members=2)
        return plain.members[0].units[:3] / [*units, units[0]]

    np.testing.assert_allclose(sizes(1e6, 1e-3), sizes(1.0, 1.0), rtol=1e-6)
