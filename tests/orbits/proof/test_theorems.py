"""What a proof assumes is proved as an identity, and is refused where it is not one."""

import dataclasses
import functools

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.ball_arithmetic.arithmetic import acb, arb, precision
from jaxdyn.ball_arithmetic.field import scene_formulas
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.system import Effect
from orbits.proof import posing, proving
from orbits.proof.posing import equations_of
from orbits.proof.proving import certify, on_one_curve
from orbits.proof.stability import spectrum, structure
from orbits.proof.theorems import Theorems, missing


def _formulas(rate, k: int, *more):
    return scene_formulas(jaxdyn.ode(rate, np.ones(k), 1.0), *more)


def _van_der_pol(t, y):
    return [y[1], (1 - y[0] ** 2) * y[1] - y[0]]


@functools.cache
def _cycle():
    return orbits.find(jaxdyn.ode(_van_der_pol, [2.0, 0.0], 6.66))


@functools.cache
def _closure():
    return equations_of(_cycle())


def test_a_drive_below_the_rounding_is_seen_in_the_formulas():
    # In doubles the rate is the same at all times; no motion of it is periodic with any period.
    def rate(t, y):
        slow, fast = _van_der_pol(t, y)
        return [slow, fast + 1e-30 * t]

    scene = jaxdyn.ode(rate, [2.0, 0.0], 6.66)
    with pytest.raises(ValueError, match="expected a drive by sines and cosines of w t"):
        orbits.prove(orbits.find(scene))


def test_an_integral_that_depends_on_time_is_none():
    rate = lambda t, y: [y[1], jnp.zeros(())]  # noqa: E731
    formulas, (found,) = _formulas(rate, 2, lambda _, t, y: jnp.stack([y[1], y[1] + t, y[0]]))
    known = Theorems.of(formulas)
    assert [known.is_conserved(one) for one in found] == [True, False, False]


def test_hyperbolic_functions_have_their_identities():
    rate = lambda t, y: [y[1], -jnp.sinh(y[0])]  # noqa: E731
    energies = lambda _, t, y: jnp.stack(  # noqa: E731
        [y[1] ** 2 / 2 + jnp.cosh(y[0]), y[1] ** 2 / 2 + jnp.exp(y[0]), jnp.cosh(y[0])]
    )
    formulas, (found,) = _formulas(rate, 2, energies)
    known = Theorems.of(formulas)
    assert [known.is_conserved(one) for one in found] == [True, False, False]
    assert known.is_symmetry(-np.eye(2, dtype=int), 1)


@pytest.mark.slow
def test_spared_equations_need_integrals_that_do_not_depend_on_each_other():
    swing = orbits.find(scenes.pendulum(angle=2.0), period=2.7, hold="theta")
    system = equations_of(swing)
    assert (list(system.integrals), len(system.spared)) == (["energy"], 1)
    with precision(100):
        end = numbers = [arb(x) for x in system.values]
        assert system.spared_hold(end[:2], numbers)
        # Over this box the energy's derivative by either entry may be 0.
        wide = [x + arb(0, 4) for x in end[:2]]
        assert not system.spared_hold(wide, numbers)
        again = {"energy": system.integrals["energy"], "the same": system.integrals["energy"]}
        twice = dataclasses.replace(system, integrals=again, spared=(0, 1))
        assert not twice.spared_hold(end[:2], numbers)


@pytest.mark.slow
def test_a_driven_motion_is_followed_over_a_whole_period():
    driven = dataclasses.replace(_closure(), drive=(1.0, 1))
    assert missing(driven) == ""
    assert "part of its period" in missing(dataclasses.replace(driven, parts=2))


def test_a_reversal_of_another_order_proves_nothing():
    quarter = np.array([[0, -1], [1, 0]])
    turned = dataclasses.replace(_closure(), parts=2, reversals=(quarter, quarter))
    assert "order 2" in missing(turned)


def test_a_reversal_that_exchanges_entries_has_one_equation_for_each_pair():
    swap = orbits.Symmetry(places=(1, 0, 3, 2), signs=(1, 1, -1, -1), reversing=True)
    embed, end, goal = posing._maps(orbits.reversal(swap), 4)
    assert end.tolist() == [[1, -1, 0, 0], [0, 0, 1, 1]]
    assert embed.tolist() == [[1, 0], [1, 0], [0, 1], [0, -1]]
    assert goal.shape == (2, 4)


def test_constant_powers_are_functions_of_their_own():
    rate = lambda t, y, p: [p["a"] ** 0.3 * y[0]]  # noqa: E731
    formulas, _ = scene_formulas(jaxdyn.ode(rate, [1.0], 1.0, params={"a": 2.0}))
    assert Theorems.of(formulas).is_symmetry(np.array([[-1]]), 1)


def test_equilibria_and_negative_periods_are_no_orbits():
    orbit, system = _cycle(), _closure()
    period = arb(orbit.period)
    # The origin is the only state nearby that returns after this time: it never leaves.
    held = dataclasses.replace(system, held=(2,))
    still = certify(orbit, held, [arb(0), arb(0), period], 1e-12, 20, bits=200)
    assert (still.proved, "equilibrium" in still.reason) == (False, True)
    assert "More digits do not help" in still.reason
    assert "Try more digits" not in still.reason
    numbers, lost = proving.solve(system, 20)
    backward = [
        -x if name == "period" else x for x, name in zip(numbers, system.names, strict=True)
    ]
    again = certify(orbit, system, backward, 1e-12, 20 + lost, bits=200)
    assert not again.proved


def test_relative_orbits_have_fewer_multipliers_of_one():
    scene = scenes.three_body()
    formulas, (found,) = scene_formulas(scene, posing._integrals)
    plain = dataclasses.replace(_closure(), formulas=formulas, candidates=tuple(found))
    (turn,) = (
        g for n, g in zip(_names(scene), proving._generators(scene), strict=True) if "turn" in n
    )
    relative = dataclasses.replace(plain, generator=turn[0].astype(int))
    form = np.asarray(proving.symplectic_form(scene, scene.y0))
    counts = []
    for system in (plain, relative):
        candidates = posing.integrals_of(system, scene)
        known = structure.structure(system, candidates, proving._generators(scene), [form])
        assert known.form is not None
        counts.append((len(known.integrals), len(known.generators)))
    # Translations and momentum do not commute with a rotation: the angular momentum does.
    assert counts[0] == (4, 3)
    assert counts[1] == (2, 1)


def _names(scene):
    return list(scene.system.generators(scene.y0))


def test_a_form_that_is_not_antisymmetric_says_nothing_of_multipliers():
    formulas, _ = _formulas(lambda t, y: [-y[0], -y[1]], 2)
    system = dataclasses.replace(_closure(), formulas=formulas)
    assert structure.structure(system, {}, [], [np.eye(2)]).form is None
    rotation, _ = _formulas(lambda t, y: [y[1], -y[0]], 2)
    form = np.array([[0.0, 1.0], [-1.0, 0.0]])
    system = dataclasses.replace(system, formulas=rotation)
    assert (structure.structure(system, {}, [], [form]).form == form).all()
    # The rotation of a relative orbit must keep it too; this one stretches.
    stretched = dataclasses.replace(system, generator=np.array([[1, 0], [0, 0]]))
    assert structure.structure(stretched, {}, [], [form]).form is None


@pytest.mark.parametrize(
    ("angles", "verdict"), [((0.3, 0.7), "stable"), ((0.3, 0.0), "undecided"), ((), "stable")]
)
def test_multipliers_that_may_be_one_are_not_on_the_circle_for_certain(angles, verdict):
    near = arb(0, 1e-9)
    values = [
        acb(arb(x).cos() + near, sign * arb(x).sin() + (near if x else arb(0)))
        for x in angles
        for sign in ((1, -1) if x else (1,))
    ]
    assert spectrum._verdict(values, [acb(1)], True, True) == verdict


class _Trap(Effect):
    """Each body is drawn to the origin by its distance."""

    velocity_dependent = False

    def potential(self, t, r, m):
        return 0.5 * jnp.sum(r * r)


@pytest.mark.slow
@pytest.mark.parametrize("order", [(0, 1, 2, 3), (0, 2, 1, 3)])
def test_bodies_that_follow_each_other_in_any_order_are_on_one_curve(order):
    system = FreePoints(np.ones(4))
    angles = np.array(order) * (np.pi / 2)
    r = np.round(np.stack([np.cos(angles), np.sin(angles)], 1))
    v = np.round(np.stack([-np.sin(angles), np.cos(angles)], 1))
    circle = np.concatenate([r.ravel(), v.ravel()])
    apart = circle.copy()
    apart[0] = 1.25
    for start, expected in ((circle, None), (apart, False)):
        scene = jaxdyn.Scene(system, (_Trap(),), y0=start, t1=6.0)
        assert _on_one_curve_after_a_turn(scene) is expected


def _on_one_curve_after_a_turn(scene):
    formulas, _ = scene_formulas(scene)
    whole = dataclasses.replace(
        _closure(),
        formulas=formulas,
        field=posing.ball_field(formulas),
        sizes=(1.0,) * 16,
        embed=np.eye(16, dtype=int),
        goal=np.eye(16, dtype=int),
    )
    numbers = [*(arb(x) for x in np.asarray(scene.y0).tolist()), 2 * arb.pi()]
    return on_one_curve(scene, whole, numbers, 150)
