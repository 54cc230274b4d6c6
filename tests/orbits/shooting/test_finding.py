"""The finder on orbits known in closed form; every way a search can end; every misuse."""

import re
import time
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import odes
import pytest
from helpers import SOLVED, gap, kepler, kepler_state, refusal
from scipy.special import ellipk
from two_cycles import two_cycles

import jaxdyn
import orbits
from jaxdyn import Effect, Scene, effects, scenes
from jaxdyn.analysis.energy import energy
from jaxdyn.formulations.newton import FreePoints
from orbits import Outcome, motion
from orbits.shooting import descent, equations, outcomes, segment
from orbits.shooting.strategy import Effort


class Spring(Effect):
    """The potential k r^2 / 2, as a user would write it: no force."""

    k: jax.Array
    velocity_dependent: ClassVar[bool] = False

    def potential(self, t, r, m):
        return 0.5 * self.k * jnp.sum(r * r)


def van_der_pol(mu=1.0):
    return jaxdyn.ode(odes.van_der_pol, [2.0, 0.1], 6.5, params=mu, names=["x", "v"])


def stuart_landau(a=0.3, b=0.4, w=1.1):
    return jaxdyn.ode(odes.stuart_landau, [0.6, 0.1], 5.5, params=(a, b, w))


def never(t, y):
    """To the right, and never back; faster and faster."""
    return 1 + y * y


def ever(t, y):
    """To the right, slower and slower."""
    return jnp.exp(-y)


def spring(y0=(1.0, 0.2), k=4.0, t1=3.0):
    return Scene(FreePoints(1.0, d=1), (Spring(jnp.asarray(k)),), y0=y0, t1=t1)


@pytest.fixture(scope="module")
def cycle():
    return orbits.find(van_der_pol())


def test_a_kepler_ellipse_has_keplers_period():
    rough = kepler_state(0.5, 0.0) * 1.01
    orbit = orbits.find(kepler(0.5), rough, 6.2)
    energy = orbits.identify(orbit).energy
    # Reduced mass 1/4, G m1 m2 = 1/4: a = -1 / (8 E), and T = 2 pi a^(3/2) by Kepler's third law.
    assert abs(orbit.period - 2 * np.pi * (-1 / (8 * energy)) ** 1.5) < SOLVED
    assert gap(orbit.y0, rough) < 0.15
    assert orbit.residual < SOLVED
    assert orbits.analysis.closure(orbit) < SOLVED


@pytest.mark.slow
def test_a_spring_given_by_its_potential():
    orbit = orbits.find(spring())
    assert abs(orbit.period - np.pi) < SOLVED  # 2 pi / sqrt(k / m)
    assert orbit.residual < SOLVED


def test_van_der_pols_cycle(cycle):
    assert abs(cycle.period - odes.VAN_DER_POL) < SOLVED
    assert cycle.residual < SOLVED


@pytest.mark.parametrize("parameters", [(0.3, 0.4, 1.1), (0.5, -0.2, 1.3)])
def test_stuart_landaus_cycle(parameters):
    a, b, w = parameters
    orbit = orbits.find(stuart_landau(*parameters))
    assert abs(orbit.period - 2 * np.pi / (w + a * b)) < SOLVED
    assert abs(np.linalg.norm(orbit.y0) - np.sqrt(a)) < SOLVED


@pytest.mark.parametrize("segments", [2, 4])
@pytest.mark.slow
def test_segments_give_the_same_orbit(cycle, segments):
    orbit = orbits.find(van_der_pol(), segments=segments)
    assert abs(orbit.period - cycle.period) < SOLVED
    assert orbits.analysis.closure(orbit) < SOLVED
    # The phase is free; the cycle is one curve, so the amplitude on it is not.
    assert (
        abs(orbits.stability(orbit).nontrivial[0] - orbits.stability(cycle).nontrivial[0]) < 1e-10
    )
    assert orbit.y0.shape == (2,)


@pytest.mark.slow
def test_segments_with_a_symmetry():
    ring = orbits.choreography(3)
    one, two = (orbits.find(scenes.three_body(), closing=ring, segments=n) for n in (1, 2))
    assert abs(one.period - two.period) < 1e-6  # the printed start, 8 digits, chooses the scale
    a, b = orbits.identify(one).scale_free, orbits.identify(two).scale_free
    assert abs(a - b) < SOLVED


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, -1])
def test_the_direction_round_the_ring_is_the_guesses(order):
    ring = orbits.choreography(3)[::order]
    orbit = orbits.find(scenes.three_body(), closing=ring)
    assert orbit.closing == orbits.choreography(3)[1]
    y0 = jnp.asarray(scenes.EIGHT)
    backwards = y0.at[6:].multiply(-1)
    orbit = orbits.find(scenes.three_body(backwards), closing=ring)
    assert orbit.closing == orbits.choreography(3)[0]


def test_new_numbers_never_compile_again(cycle):
    # A direct count: the one compiled function of the finder.
    before = segment.compiled_end._cache_size()
    for mu, y0, period in ((1.0, [2.0, 0.0], 6.6), (0.9, [1.9, 0.1], 6.5), (1.1, [2, 0.2], 6.7)):
        assert orbits.find(van_der_pol(mu), y0, period).ok
    assert segment.compiled_end._cache_size() == before


def test_new_masses_never_compile_again():
    orbits.find(scenes.three_body(), closing=orbits.choreography(3))
    before = segment.compiled_end._cache_size()
    slow = np.sqrt(2.0)  # twice the mass: the same curve, faster
    y0 = np.array(scenes.EIGHT) * np.repeat([1.0, slow], 6)
    scene = scenes.three_body(y0, m=(2.0, 2.0, 2.0), t1=scenes.EIGHT_PERIOD / slow)
    orbit = orbits.find(scene, closing=orbits.choreography(3)[1])
    assert abs(orbit.period * slow - scenes.EIGHT_PERIOD) < 1e-6
    assert segment.compiled_end._cache_size() == before


def test_bounds_hold_for_every_point_looked_at(monkeypatch):
    seen, original = [], equations.Equations.__call__

    def watched(self, x, *limits):
        seen.append(x)
        return original(self, x, *limits)

    monkeypatch.setattr(equations.Equations, "__call__", watched)
    low, high = np.array([1.0, -2.0, 6.0]), np.array([1.9, -0.5, 7.0])
    orbit = orbits.find(van_der_pol(), [1.9, -0.5], lower=low, upper=high)
    assert abs(orbit.period - odes.VAN_DER_POL) < SOLVED
    for x in (*seen, [*orbit.y0, orbit.period]):
        assert (low <= x).all()
        assert (x <= high).all()


def test_a_fixed_entry_of_the_start_chooses_the_phase():
    inf = np.inf
    orbit = orbits.find(van_der_pol(), lower=[-inf, 0.0, 1.0], upper=[inf, 0.0, inf])
    assert orbit.y0[1] == 0.0
    assert abs(orbit.period - odes.VAN_DER_POL) < SOLVED
    assert abs(orbit.y0[0] - 2.00861986087484313650940188) < SOLVED  # the amplitude, mu = 1


def test_progress_is_reported():
    steps = []
    orbit = orbits.find(van_der_pol(), report=steps.append)
    assert [step.index for step in steps] == list(range(orbit.iterations + 1))
    assert steps[0].step == 0.0
    assert steps[0].period == 6.5
    assert min(step.residual for step in steps) == orbit.residual


@pytest.mark.slow
@pytest.mark.parametrize("off", [0.97, 1.0, 1.03])
@pytest.mark.parametrize("hold", [(), ("y",)], ids=["free", "y held"])
def test_a_curved_valley_of_the_closing_error_is_followed_to_its_orbit(hold, off):
    # A circle about the planet alone, whose end is eight times its radius from the start in Hill's
    # problem: up to 150 short steps lead to an orbit.
    turn = 0.5**-1.5 - 1.0
    guess = scenes.hill(x=0.5, vy=0.5 * turn, t1=off * 2 * np.pi / turn)
    orbit = orbits.find(guess, hold=hold)
    assert 0.85 < orbit.period / guess.t1 < 1.15
    assert orbit.shift < 0.5
    assert orbits.recheck(orbit).closure < 1e-9


ONE_SECOND = {"lower": [-np.inf, 1.0], "upper": [np.inf, 1.0]}
ENDS = {
    Outcome.ITERATION_LIMIT: (van_der_pol(), {"max_iterations": 2}),
    # x(1) - x(0) is least, and not zero, in the middle.
    Outcome.NO_DESCENT: (jaxdyn.ode(never, [0.3]), ONE_SECOND),
    Outcome.COLLISION: (kepler(0.0), {"y0": [-0.5, 0, 0.5, 0, 0, 0, 0, 0]}),
    # x(1) - x(0) falls for ever as x grows.
    Outcome.ESCAPE: (jaxdyn.ode(ever, [0.01]), ONE_SECOND),
    Outcome.TRIVIAL: (spring(), {"y0": [0.0, 0.0]}),
    Outcome.BOUND: (van_der_pol(), {"lower": [1.9, -0.1, 6.0], "upper": [2.1, 0.2, 6.2]}),
    # Ten million radians, where a step takes about one.
    Outcome.STEP_LIMIT: (spring(k=1e12, t1=10.0), {}),
    Outcome.DESCENT_ENDED: (jaxdyn.ode(never, [0.3]), {**ONE_SECOND, "strategy": orbits.Descent()}),
    Outcome.TIME_LIMIT: (van_der_pol(), {"seconds": 1e-9}),
}


def test_every_outcome_has_its_case():
    # BOUND_PASSED and OPEN_CHAIN are ends of searches for chains, with cases in test_hopping,
    # MESH_LIMIT one of collocation, in test_collocation, NO_OTHER one of deflation, in
    # test_deflation.
    elsewhere = {Outcome.BOUND_PASSED, Outcome.OPEN_CHAIN}
    elsewhere |= {Outcome.MESH_LIMIT, Outcome.NO_OTHER}
    below = {Outcome.UNCONFIRMED, Outcome.UNDETERMINED}
    assert ENDS.keys() == set(Outcome) - {Outcome.FOUND, *elsewhere, *below}


@pytest.mark.parametrize("outcome", ENDS, ids=lambda outcome: outcome.name)
def test_every_way_a_search_fails(outcome):
    scene, options = ENDS[outcome]
    orbit = orbits.find(scene, **options, throw=False)
    assert orbit.outcome == outcome
    assert not orbit.ok
    hint = scene.singular if outcome == Outcome.COLLISION else ""
    assert orbit.message == " ".join(filter(None, [outcome.message, hint, orbit.hint]))
    # The best iterate is there, and its error is not small.
    assert np.isfinite(orbit.y0).all()
    if outcome != Outcome.TRIVIAL:
        assert not orbit.residual <= 1e-12


@pytest.mark.sample("ITERATION_LIMIT", "BOUND", "TIME_LIMIT")
@pytest.mark.parametrize("outcome", ENDS, ids=lambda outcome: outcome.name)
def test_a_search_that_fails_raises_what_it_tried(outcome):
    scene, options = ENDS[outcome]
    hint = scene.singular if outcome == Outcome.COLLISION else ""
    with pytest.raises(orbits.SearchError) as caught:
        orbits.find(scene, **options)
    said = f"{outcome.message} {hint}".strip()
    assert str(caught.value).startswith(f"{said} Tried: ")
    assert " of compiling." in str(caught.value)


SYMMETRIC = {
    "mirror": (
        scenes.restricted_three_body_in_space(),
        orbits.closing.mirror,
        'The guess is symmetric: closing=orbits.closing.mirror(scene, "xz") needs half',
    ),
    "reversal": (
        scenes.pendulum(t1=3.0),
        lambda scene: orbits.reversal(orbits.time_reversal(2)),
        "The guess is symmetric: closing=orbits.reversal(orbits.time_reversal(2)) needs half",
    ),
}


@pytest.mark.parametrize("symmetry", SYMMETRIC)
def test_a_search_that_fails_suggests_the_closing_of_a_symmetric_guess(symmetry):
    scene, closing, hint = SYMMETRIC[symmetry]
    with pytest.raises(orbits.SearchError, match=re.escape(hint)):
        orbits.find(scene, max_iterations=0)
    best = orbits.find(scene, max_iterations=0, throw=False)
    assert hint in best.message
    assert hint not in best.cause
    for other, options in (
        (scene, {"closing": closing(scene)}),
        (scene.starting(scene.y0 + 0.01), {}),  # no longer symmetric
    ):
        with pytest.raises(orbits.SearchError) as caught:
            orbits.find(other, max_iterations=0, **options)
        assert "symmetric" not in str(caught.value)
        best = orbits.find(other, max_iterations=0, throw=False, **options)
        assert "symmetric" not in best.message


@pytest.mark.sample("6.0-False")
@pytest.mark.parametrize(("growth", "found"), [(3.0, True), (6.0, False)])
def test_an_orbit_that_doubles_do_not_hold_is_none(growth, found):
    # exp(12 pi) = 2e16 times the rounding of a start: its segments join all the same.
    scene = jaxdyn.ode(odes.askew, odes.ASKEW[:, 0], 2 * np.pi, params=growth)
    orbit = orbits.find(scene, throw=False)
    assert orbit.residual < SOLVED
    assert orbit.outcome == (Outcome.FOUND if found else Outcome.UNDETERMINED)
    assert (orbits.recheck(orbit).closure < 1e-2) == found


@pytest.mark.parametrize(("off", "found"), [(1e-13, True), (1e-3, False)])
def test_an_orbit_that_another_integrator_does_not_confirm_is_none(off, found, monkeypatch):
    # No rate is known on which the two are sure to disagree: the second one is made to.
    def advanced(*args, **options):
        flow = motion.advance(*args, **options)
        return eqx.tree_at(lambda f: f.y1, flow, flow.y1 + off)

    monkeypatch.setattr(outcomes, "advance", advanced)
    orbit = orbits.find(van_der_pol(), throw=False)
    assert orbit.ok == found
    assert orbit.outcome == (Outcome.FOUND if found else Outcome.UNCONFIRMED)


def test_messages_say_what_to_do():
    words = {
        Outcome.FOUND: "closes",
        Outcome.ITERATION_LIMIT: "Raise max_iterations",
        Outcome.NO_DESCENT: "more segments",
        Outcome.COLLISION: "singularity",
        Outcome.ESCAPE: "Set bounds",
        Outcome.TRIVIAL: "lower bound on the period",
        Outcome.BOUND: "Widen them",
        Outcome.STEP_LIMIT: "simulate()",
        Outcome.BOUND_PASSED: "Start elsewhere",
        Outcome.OPEN_CHAIN: "states and spans",
        Outcome.DESCENT_ENDED: "Start elsewhere",
        Outcome.MESH_LIMIT: "Raise goal",
        Outcome.NO_OTHER: "raise max_iterations",
        Outcome.UNCONFIRMED: "Pass a smaller rtol",
        Outcome.TIME_LIMIT: "raise seconds=",
        Outcome.UNDETERMINED: "impose a symmetry",
    }
    assert words.keys() == set(Outcome)
    for outcome, word in words.items():
        assert word in outcome.message


def test_a_search_that_fails_says_what_it_tried():
    scene = jaxdyn.ode(never, [0.3])
    with pytest.raises(orbits.SearchError) as failed:
        orbits.find(scene, **ONE_SECOND, strategy=orbits.Descent())
    tried = "Tried: a descent on the closing error; Newton's method in 1 segment"
    assert tried in str(failed.value)


def test_a_descent_that_leads_astray_loses_no_orbit(monkeypatch):
    def astray(equations, x, **options):
        del equations, options
        return descent.DescentResult(x=100 * x, residual=1.0, near=False, arrived=False)

    monkeypatch.setattr(descent, "descend", astray)
    assert orbits.find(van_der_pol(), strategy=orbits.Descent()).iterations > 0
    orbit = orbits.find(
        jaxdyn.ode(never, [0.3]), **ONE_SECOND, strategy=orbits.Descent(), throw=False
    )
    assert orbit.outcome == Outcome.DESCENT_ENDED


def test_a_descent_that_takes_its_time_loses_no_orbit(monkeypatch):
    def endless(equations, x, *, effort, **bounds):
        del equations, bounds
        while not effort.over:
            time.sleep(0.01)
        return descent.DescentResult(x=x, residual=1.0, near=False, arrived=False)

    monkeypatch.setattr(descent, "descend", endless)
    scene = van_der_pol()
    assert orbits.find(scene).ok  # compiled
    orbit = orbits.find(scene, strategy=orbits.Descent(), seconds=20.0)
    assert abs(orbit.period - odes.VAN_DER_POL) < SOLVED


def test_compiling_does_not_count(monkeypatch):
    effort = Effort(1e-12, 1e-14, 60, print, seconds=5.0)
    monkeypatch.setattr(type(effort.clock), "seconds", property(lambda clock: 9.0))
    monkeypatch.setattr(type(effort.clock), "compiling", property(lambda clock: 7.0))
    assert not effort.over
    assert effort.share(0.5).seconds == 2.0 + 0.5 * 3.0
    effort.begin("a descent")
    assert str(effort) == "Tried: a descent. In 2 s, and 7 s of compiling."
    monkeypatch.setattr(type(effort.clock), "seconds", property(lambda clock: 12.5))
    assert effort.over


@pytest.mark.parametrize("kind", ["Shooting", "Descent", "Collocation", "Deflated"])
def test_every_strategy_ends_when_its_time_is_up(kind):
    scene = van_der_pol()
    known = ([orbits.find(scene)],) if kind == "Deflated" else ()
    strategy = getattr(orbits, kind)(*known)
    start = time.monotonic()
    orbit = orbits.find(scene, [5.0, 3.0], 9.0, strategy=strategy, seconds=1e-9, throw=False)
    assert orbit.outcome == Outcome.TIME_LIMIT
    assert orbit.iterations <= 1
    assert time.monotonic() - start < 100  # compilation only, on any machine
    for wrong in (0.0, -1.0, np.nan):
        with pytest.raises(ValueError, match=r"^seconds: expected > 0, got"):
            orbits.find(scene, seconds=wrong)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (
            orbits.Descent,
            r"Deflated\(known\), Collocation\(\), got Descent. Call it: orbits.Descent",
        ),
        ("rough", r"strategy: expected one of orbits.Shooting\(\), .*, got 'rough'"),
    ],
)
def test_what_is_no_strategy_is_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        orbits.find(van_der_pol(), strategy=wrong)


def test_arguments_of_the_version_before_warn_and_are_the_strategies():
    scene, known = van_der_pol(), orbits.find(van_der_pol())
    for old, text in (
        ({"rough": True}, r"Descent\(\)"),
        ({"collocation": False}, r"Shooting\(\)"),
        ({"unlike": [known]}, r"Deflated\(known\)"),
    ):
        with pytest.warns(DeprecationWarning, match=f"are now strategy=orbits.{text}") as warned:
            orbit = orbits.find(scene, throw=False, max_iterations=5, **old)
        assert warned[0].filename == __file__
        assert orbit.outcome in (Outcome.FOUND, Outcome.NO_OTHER)
    for pair in ({"rough": True, "collocation": True}, {"unlike": [known], "rough": True}):
        with pytest.raises(ValueError, match="strategy: expected one, and no other way to look"):
            orbits.find(scene, **pair)
    with pytest.raises(ValueError, match="got also rough"):
        orbits.find(scene, strategy=orbits.Shooting(), rough=True)


@pytest.mark.parametrize("period", [0.05, 0.5, 2.0])
def test_the_trivial_period_is_not_an_orbit(period):
    orbit = orbits.find(spring(), None, period, throw=False)
    assert orbit.outcome == Outcome.TRIVIAL or abs(orbit.period - np.pi) < SOLVED


def test_an_equilibrium_is_not_an_orbit():
    # With the period held at 3 only x = v = 0 closes.
    held = {"lower": [-9, -9, 3.0], "upper": [9, 9, 3.0]}
    assert orbits.find(van_der_pol(), **held, throw=False).outcome == Outcome.TRIVIAL


def test_a_decay_that_has_nearly_ended_is_not_an_orbit():
    # It moves by less than samples of a motion are held to.
    def decay(t, y):
        x, z = y / 1e-9
        return [1e-24 * (1 + 1e-9 * x**2 * z - 4 * x), 1e-24 * (3 * x - x**2 * z)]

    settled = jaxdyn.ode(decay, [2.5000000018711975e-10, 1.1979457347051062e-08], 7e15)
    assert orbits.find(settled, throw=False).outcome == Outcome.TRIVIAL


@pytest.mark.parametrize("system", ["", "earth-moon"])
def test_a_guess_at_an_equilibrium_whose_rate_is_rounding_is_at_rest(system):
    scene = scenes.restricted_three_body_in_space(system=system)
    at_l1 = scene.starting(scenes.libration_point(scene, "L1"))
    assert orbits.find(at_l1, throw=False).outcome == Outcome.TRIVIAL


@pytest.mark.slow
def test_a_forced_motion_may_start_at_rest():
    class Push(Effect):
        velocity_dependent: ClassVar[bool] = False

        def force(self, t, r, v, m):
            return jnp.sin(t) * jnp.ones_like(r)

    # x'' = -4 x + sin t: the periodic answer is sin(t) / 3, period 2 pi, imposed by bounds.
    scene = spring([0.0, 0.0], k=4.5, t1=2 * np.pi) + Push()
    period = 2 * np.pi
    orbit = orbits.find(scene, lower=[-9, -9, period], upper=[9, 9, period])
    assert gap(orbit.y0, jnp.array([0.0, 1 / 3.5])) < SOLVED


MISUSE = [
    ({"period": 0.0}, "period: expected > 0, got 0.0. It is a time."),
    ({"period": -1.0}, "period: expected > 0, got -1.0"),
    ({"period": np.nan}, "period: expected finite numbers, got nan"),
    ({"period": [6.0, 7.0]}, r"period: expected shape \(\), got shape \(2,\)"),
    ({"y0": [1.0]}, r"y0: expected shape \(2,\), got shape \(1,\)"),
    ({"y0": [[1.0, 2.0]]}, r"y0: expected shape \(2,\), got shape \(1, 2\)"),
    ({"y0": [1.0, np.nan]}, r"y0: expected finite numbers, got nan at index \[1\]"),
    ({"y0": [np.inf, 1.0]}, r"y0: expected finite numbers, got inf at index \[0\]"),
    ({"lower": [0.0, 0.0]}, r"lower: expected shape \(3,\), got shape \(2,\).*each of the 2"),
    ({"upper": np.ones((3, 1))}, r"upper: expected shape \(3,\), got shape \(3, 1\)"),
    ({"lower": [np.nan, 0, 1]}, "lower: expected numbers, got NaN. Use -inf or inf"),
    (
        {"lower": [0, 5, 1], "upper": [9, 4, 9]},
        r"lower: expected <= upper = 4.0 at index 1, got 5.0. Swap them\?",
    ),
    ({"upper": [9, 9, 0.0]}, "upper: expected a positive last entry, for the period, got 0.0"),
    ({"lower": [np.inf, 0, 1]}, "bounds: expected some finite numbers between them"),
    ({"segments": 0}, "segments: expected a whole number, at least 1, got 0"),
    ({"goal": 0.0}, "goal: expected > 0, got 0.0"),
    ({"goal": np.nan}, "goal: expected finite numbers, got nan"),
    ({"rtol": -1e-9}, "rtol: expected between 1e-16 and 0.01, got -1e-09"),
    ({"closing": orbits.choreography(3)}, "closing: expected a permutation of the 2 entries"),
    ({"closing": ()}, "closing: expected at least one closing condition, got none"),
    (
        {"closing": orbits.Return(parts=0)},
        "closing: expected at least one part of a period, got 0",
    ),
    (
        {"closing": orbits.Return(orbits.Symmetry((1, 0)))},
        "closing: expected a symmetry of the scene, got one that",
    ),
]


@pytest.mark.parametrize(("options", "message"), MISUSE)
def test_misuse(options, message):
    with pytest.raises(ValueError, match=message):
        orbits.find(van_der_pol(), **options)


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (scenes.three_body(m=(0.0, 0.0, 0.0)), "mass: expected one that is not 0, got no mass"),
        (scenes.three_body(m=(1.0, -2.0, 1.0)), "mass: expected >= 0, got -2.0"),
        (scenes.three_body(m=(1.0, np.nan, 1.0)), "mass: expected finite numbers, got nan"),
        (scenes.three_body(G=np.nan), "G: expected finite numbers, got nan"),
        (scenes.three_body(t1=-1.0), "period: expected > 0, got -1.0"),
        (
            scenes.three_body([1.0, 2, 0, 0, 1, 2] + [0.0] * 6),
            r"bodies at different points, got bodies 1 and 3 both at \[1.0, 2.0\]",
        ),
    ],
)
def test_scenes_that_make_no_sense(scene, message):
    with pytest.raises(ValueError, match=message):
        orbits.find(scene)


@pytest.mark.parametrize("m", [(1.0, 1.0, 1.001), (2.0, 1.0, 1.0)])
def test_unequal_bodies_cannot_take_each_others_places(m):
    with pytest.raises(ValueError, match=r"closing: expected a symmetry .*equal masses"):
        orbits.find(scenes.three_body(m=m), closing=orbits.choreography(3))


def test_32_bit_floats_are_refused():
    with jax.enable_x64(False), pytest.raises(ValueError, match="floats: expected 64-bit floats"):
        orbits.find(van_der_pol())


def test_an_orbit_is_a_record_of_arrays(cycle):
    leaves = jax.tree.leaves(eqx.filter(cycle, eqx.is_array))
    assert all(leaf.dtype == float for leaf in leaves)
    assert cycle.scene.system.params == 1.0
    assert (cycle.period, cycle.rtol) == (float(cycle.scene.t1), 1e-14)


def test_a_driven_motion_needs_the_period_of_its_drive():
    driven = scenes.oscillator(k=4.0) + effects.SinusoidalForce([1.0], 1.0)
    with pytest.raises(ValueError, match=r"period: expected a multiple of the drive's"):
        orbits.find(driven, [0.0, 0.3], 9.0)  # between two of them
    found = orbits.find(driven, [0.0, 0.3], 6.0)
    # All motions have the drive's period here, as the free ones turn twice in it (k = 4).
    assert found.ok
    assert abs(found.period - 2 * np.pi) < 1e-14  # polished as the start is


def _pulses(t, y):
    train = jnp.exp(400 * (jnp.cos(jnp.pi * (t - 1.03)) - 1))
    return [y[1], -0.2 * y[1] - y[0] + train]


def _square_wave(t, y):
    return [y[1], -0.2 * y[1] - y[0] + jnp.sign(jnp.sin(1.3 * t + 0.3))]


def _square_wave_from_its_switch(t, y):
    return [y[1], -0.2 * y[1] - y[0] + jnp.sign(jnp.sin(1.3 * t))]


@pytest.mark.sample("wave")
@pytest.mark.parametrize(
    ("rate", "guess", "period", "start"),
    [
        # By DOP853 piece by piece, and a linear system for the start.
        (_pulses, 1.7, 2.0, (0.0237026528875, -0.0001352026477)),
        (_square_wave, 4.9, 4.83321946706122, (-1.0913688545028, -1.8124949586433)),
        (_square_wave_from_its_switch, 4.8, 4.83321946706122, (-0.6107846885, -2.338118370)),
    ],
    ids=["pulses", "wave", "wave from its switch"],
)
def test_the_period_of_a_drive_is_read_from_the_rate(rate, guess, period, start):
    found = orbits.find(jaxdyn.ode(rate, [0.0, 0.0], guess))
    assert found.period == pytest.approx(period, rel=1e-14)
    assert np.allclose(found.y0, start, rtol=0, atol=1e-8)


def test_a_rough_guess_is_led_to_an_orbit_by_descent():
    # Newton's method alone shrinks this period to zero, where everything closes.
    scene, start, period = scenes.pendulum(angle=2.0), [-2.3, 1.9], 6.0
    steps = []
    found = orbits.find(scene, start, period, strategy=orbits.Descent(), report=steps.append)
    assert found.residual < 1e-12
    assert len(steps) > found.iterations + 1
    level = float(energy(scene, jnp.zeros(()), found.y0))
    exact = 4 / np.sqrt(9.81) * ellipk(0.5 * (1 + level / 9.81))
    turns = found.period / exact
    assert abs(turns - round(turns)) < 1e-9
    held = orbits.find(scene, start, period, strategy=orbits.Descent(), hold="theta")
    assert float(held.y0[0]) == pytest.approx(start[0], abs=1e-12)


@pytest.mark.slow
def test_descent_leads_to_where_newtons_method_begins():
    steps = []
    found = orbits.find(
        two_cycles(), [1.6, 0.3], 1.6, strategy=orbits.Descent(), report=steps.append
    )
    assert found.period == pytest.approx(2 * np.pi / 5, rel=1e-11)
    descent = steps[: len(steps) - found.iterations]
    assert descent[-1].residual < 0.01 * descent[0].residual


def swing(**options):
    return orbits.find(scenes.pendulum(), **({"y0": [1.0, 0.0], "period": 2.0} | options))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: orbits.find(Scene(FreePoints([]), (), y0=[])),
            "system: expected a system with a state",
        ),
        (lambda: swing(segments=10**6), "segments: expected at most 256, got 1000000"),
        (lambda: swing(segments=True), "segments: expected a whole number, at least 1, got True"),
        (
            lambda: swing(max_iterations=np.nan),
            "max_iterations: expected a whole number, at least 0",
        ),
        (lambda: swing(max_iterations=-1), "max_iterations: expected a whole number, at least 0"),
        (lambda: swing(period="a"), "period: expected numbers, got 'a'"),
        (lambda: swing(period=True), "period: expected numbers, got True"),
        (lambda: swing(y0="a"), "y0: expected numbers, got 'a'"),
        (lambda: swing(hold=3.0), "hold: expected a Condition, got 3.0"),
        (lambda: swing(closing="plain"), "closing: expected a Closing, got 'plain'"),
    ],
)
def test_invalid_arguments_are_refused_by_name(call, message):
    assert message in refusal(call)
