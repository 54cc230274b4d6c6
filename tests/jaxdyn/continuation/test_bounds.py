"""Families and curves of equilibria end on their bounds, where closed forms say what is there."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn import scenes
from jaxdyn.continuation import CodimensionTwo, Kind, switch_branch

ON = {"rtol": 1e-12, "atol": 1e-15}
HOPF = 470 / 19  # of Lorenz's equations: Sparrow (1982)


def lorenz(rho):
    return scenes.lorenz(rho=rho)


def of(rate, k=1):
    def make(p):
        return jaxdyn.ode(rate, jnp.zeros(k), params=p)

    return make


CUBIC = of(lambda t, y, p: [p + 3 * y[0] - y[0] ** 3])  # p = x^3 - 3 x turns at p = 2 and -2
FORK = of(lambda t, y, p: [p * y[0] - y[0] ** 3])


def kinds(family):
    return [x.kind for x in family.special]


@pytest.mark.parametrize(("down", "rho"), [(False, 28.0), (True, 14.0)])
def test_the_last_member_is_the_equilibrium_on_the_bound(down, rho):
    family = jaxdyn.continue_equilibria(lorenz, 20.0, [7.0, 7.0, 19.0], within=(14, 28), down=down)
    assert family.end == "the bounds (14, 28)"
    last = family.members[-1]
    np.testing.assert_allclose(last.parameter, rho, **ON)
    x = np.sqrt(8 / 3 * (rho - 1))
    np.testing.assert_allclose(last.state, [x, x, rho - 1], rtol=1e-12)
    slope = np.array([[-10, 10, 0], [1, -1, -x], [x, x, -8 / 3]])
    values, expected = last.eigenvalues.values, np.linalg.eigvals(slope)
    np.testing.assert_allclose(np.sort_complex(values), np.sort_complex(expected), rtol=1e-11)
    assert last.verdict == ("unstable" if rho > HOPF else "stable")
    assert last.residual < 1e-12
    assert (family.parameters[:-1] < 28).all()


@pytest.mark.parametrize(("off", "found"), [(-1e-7, []), (1e-7, [Kind.HOPF]), (0.0, [Kind.HOPF])])
def test_a_special_point_is_found_up_to_the_bound_and_not_beyond(off, found):
    within = (14, HOPF + off)
    family = jaxdyn.continue_equilibria(lorenz, 20.0, [7.0, 7.0, 19.0], within=within)
    np.testing.assert_allclose(family.parameters[-1], HOPF + off, **ON)
    assert kinds(family) == found


@pytest.mark.parametrize("down", [False, True])
@pytest.mark.parametrize("step", [0.05, 5.0])
def test_both_halves_of_a_pitchfork_end_on_the_bound(down, step):
    family = jaxdyn.continue_equilibria(FORK, -0.7, [0.0], within=(-1, 1))
    fork = switch_branch(family, family.special[0], within=(-1, 0.49), down=down, step=step)
    np.testing.assert_allclose(fork.parameters[-1], 0.49, **ON)
    np.testing.assert_allclose(fork.states[-1], -0.7 if down else 0.7, rtol=1e-12)
    assert (fork.parameters <= 0.49 + 1e-12).all()
    # At the bound itself there is the branch point alone.
    (alone,) = switch_branch(family, family.special[0], within=(-1, 0.0), down=down).members
    np.testing.assert_allclose(alone.x, 0.0, atol=1e-12)


def test_a_fold_in_the_step_that_leaves_the_bounds():
    start = (-1.01) ** 3 + 3 * 1.01, [-1.01]  # the step leads to x = -0.985, p = 1.99933
    family = jaxdyn.continue_equilibria(CUBIC, *start, within=(1.9995, 3), step=0.1)
    assert len(family.members) == 2
    np.testing.assert_allclose([x.parameter for x in family.special], [2.0], rtol=1e-12)
    np.testing.assert_allclose(family.parameters[-1], 1.9995, **ON)
    roots = np.sort(np.roots([1, 0, -3, 1.9995]).real)
    np.testing.assert_allclose(family.states[-1], -roots[1], rtol=1e-9)  # beside the fold
    # It leaves these before the fold and would return after it, beyond the last member.
    family = jaxdyn.continue_equilibria(CUBIC, *start, within=(-3, 1.9999), step=0.1)
    assert (len(family.members), family.special) == (2, ())
    np.testing.assert_allclose(family.parameters[-1], 1.9999, **ON)
    roots = np.sort(np.roots([1, 0, -3, 1.9999]).real)
    np.testing.assert_allclose(family.states[-1], -roots[2], rtol=1e-9)


def test_a_bound_that_is_touched_at_folds_does_not_end_a_family():
    family = jaxdyn.continue_equilibria(CUBIC, -1.0, [-1.9], within=(-2, 2))
    assert kinds(family) == [Kind.FOLD, Kind.FOLD]
    np.testing.assert_allclose([*family.states[-1], family.parameters[-1]], 2.0, rtol=1e-12)
    back = jaxdyn.continue_equilibria(CUBIC, -2.0, [1.0], within=(-2, 1))  # begins at a fold
    np.testing.assert_allclose(back.parameters[-1], 1.0, **ON)


@pytest.mark.parametrize("low", [0.3 * (1 - 2e-16), 0.3, 0.3 * (1 + 2e-16)])
def test_a_family_may_begin_on_a_bound(low):
    start = np.sqrt([0.3])
    inward = jaxdyn.continue_equilibria(FORK, low, start, within=(0.3, 2))
    np.testing.assert_allclose(inward.parameters[-1], 2.0, rtol=1e-12)
    outward = jaxdyn.continue_equilibria(FORK, low, start, within=(0.3, 2), down=True)
    assert (len(outward.members), outward.end) == (1, "the bounds (0.3, 2)")


def test_a_family_along_a_bound_is_within_it():
    """For p = 0 all states with v = 0 and z = -x are equilibria."""

    def chua(t, y, p):
        x, v, z = y
        return [p * (v + x / 6 - x**3 / 16), x - v + z, -14 * v]

    family = jaxdyn.continue_equilibria(of(chua, 3), -2.0, np.zeros(3), within=(-2, 1))
    other = switch_branch(family, family.special[0], members=8, within=(0, 1))
    assert len(other.members) == 8


def imperfect(p, q):
    return jaxdyn.ode(lambda t, y, c: [c[0] + c[1] * y[0] - y[0] ** 3], [0.0], params=[p, q])


CORNER = (27 / 4) ** (1 / 3)  # of the folds 27 p^2 = 4 q^3, where p = 1


@pytest.mark.parametrize("high", [CORNER - 1e-3, CORNER, CORNER + 1e-3])
def test_a_curve_leaves_through_the_side_that_it_meets_first(high):
    first = jaxdyn.continue_equilibria(lambda p: imperfect(p, 1.0), -1.0, [-1.3], within=(-1, 1))
    (fold, _) = first.special
    within = ((-2, 1), (-1, high))
    both = (fold.parameter, 1.0)
    curve = jaxdyn.continue_curve(imperfect, fold, both, within=within, step=0.3)
    p, q = curve.members[-1].parameters
    assert curve.end == f"the bounds {within}"
    if high <= CORNER:
        np.testing.assert_allclose(q, high, rtol=1e-12)
    if high >= CORNER:
        np.testing.assert_allclose(p, 1.0, rtol=1e-12)
    np.testing.assert_allclose(27 * p**2, 4 * q**3, rtol=1e-12)
    assert (curve.parameters <= [1 + 1e-12, high + 1e-12]).all()


@pytest.mark.parametrize(("low", "found"), [(-1e-3, [CodimensionTwo.CUSP]), (1e-3, [])])
def test_a_cusp_beyond_a_bound_is_not_reported(low, found):
    first = jaxdyn.continue_equilibria(lambda p: imperfect(p, 1.0), -1.0, [-1.3], within=(-1, 1))
    fold = first.special[0]
    within = ((low, 1), (-1, 2))
    curve = jaxdyn.continue_curve(imperfect, fold, (fold.parameter, 1.0), within=within, down=True)
    assert kinds(curve) == found
    np.testing.assert_allclose(curve.members[-1].parameters[0], low, rtol=1e-9)


def test_a_family_goes_on_from_its_bounds_in_its_file(tmp_path, monkeypatch):
    path = tmp_path / "run.jsonl"

    def upto(high):
        return jaxdyn.continue_equilibria(
            lorenz, 20.0, [7.0, 7.0, 19.0], within=(14, high), path=path
        )

    short, size = upto(24.0), path.stat().st_size
    (known,) = jaxdyn.continuation.load(path, lorenz)
    np.testing.assert_array_equal(known.parameters, short.parameters)
    assert known.end == short.end
    with monkeypatch.context() as patch:
        patch.setattr(jaxdyn.continuation.special.EquilibriumChart, "correct", None)
        again = upto(24.0)  # nothing is computed
    np.testing.assert_array_equal(again.parameters, short.parameters)
    assert path.stat().st_size == size
    long = upto(28.0)
    n = len(short.members)
    np.testing.assert_array_equal(long.parameters[:n], short.parameters)
    np.testing.assert_allclose(long.parameters[[n - 1, -1]], [24.0, 28.0], **ON)
    assert (kinds(short), kinds(long)) == ([], [Kind.HOPF])
    narrow = upto(22.0)
    np.testing.assert_allclose(narrow.parameters[-1], 22.0, **ON)
    np.testing.assert_array_equal(upto(28.0).parameters, long.parameters)
