"""Formulations against each other and against what is known of single mechanisms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap, primitives

from jaxdyn import scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.geometry import kinematics
from jaxdyn.integrate.simulation import solve
from jaxdyn.scenes import guides, linkages, pendula, sideways

LONG = 1000.0  # time units, some 300 swings
KEYS = jax.random.split(jax.random.key(1), 8)

#: Scenes with free coordinates and with ties: how they are made and the names of the tied ones.
TIED = {
    "pendulum": (pendula.pendulum, ("constrained",)),
    "double pendulum": (pendula.double_pendulum, ("constrained",)),
    "cart": (pendula.cart_pendulum, ("constrained",)),
    "bead": (guides.bead_on_parabola, ("constrained",)),
    "dumbbell": (linkages.dumbbell, ("constrained",)),
    "four bars": (linkages.four_bar, ("constrained", "loop")),
}
#: The map from free coordinates to those with ties.
PLACES = {
    "pendulum": lambda free: free.end,
    "double pendulum": lambda free: free.free_bars,
    "cart": lambda free: free.cartesian,
    "bead": lambda free: free.place,
    "dumbbell": lambda free: free.place,
    "four bars": lambda free: free.free_bars,
}
NOW = jnp.zeros(())


def _random_states(scene):
    """(4, k) states near the scene's start, moving."""
    noise = jax.random.uniform(KEYS[0], (4, scene.y0.size), minval=-0.5, maxval=0.5)
    return scene.y0[None] + noise


def _rates(scene, states):
    return jax.jit(jax.vmap(lambda y: scene.rate(NOW, y)))(states)


@pytest.mark.sample("bead")
@pytest.mark.parametrize("name", TIED)
def test_all_formulations_give_the_same_accelerations(name):
    make, tied = TIED[name]
    free = make(formulation="newton_euler")
    states = _random_states(free)
    rates = _rates(free, states)
    by_energies = _rates(make(formulation="lagrange"), states)
    size = float(jnp.abs(rates).max())
    assert gap(rates, by_energies) < SOLVED * size

    place = PLACES[name](free.system.mechanism)
    to_places = {"loop": free.system.mechanism.angles} if "loop" in tied else {}
    for formulation in tied:
        scene = make(formulation=formulation)
        to = to_places.get(formulation, place)

        def both(y, rate, scene=scene, to=to):
            q, v = jnp.split(y, 2)
            a = jnp.split(rate, 2)[1]
            placed, moving = jax.jvp(lambda q: to(NOW, q), (q,), (v,))
            mapped = kinematics.by_derivatives(lambda q: to(NOW, q), q, v, a)
            solved = scene.rate(NOW, jnp.concatenate([placed, moving]))
            return mapped, jnp.split(solved, 2)[1]

        mapped, solved = jax.jit(jax.vmap(both))(states, rates)
        assert gap(mapped, solved) < SOLVED * float(jnp.abs(mapped).max())


def test_momenta_are_the_same_by_either_formulation():
    scene = pendula.double_pendulum()
    other = pendula.double_pendulum(formulation="lagrange")
    for y in _random_states(scene):
        momenta = scene.system.canonical(NOW, y)
        assert gap(momenta, other.system.canonical(NOW, y)) < EXACT * 10
    # Two uniform bars that turn like one rigid bar: the total is its angular momentum.
    y = jnp.array([0.3, 0.3, 2.0, 2.0])
    _, p = jnp.split(scene.system.canonical(NOW, y), 2)
    assert gap(p.sum(), jnp.asarray(2.0 * (1 / 3 + 1 / 12 + 1.5**2))) < EXACT * 10


@pytest.fixture(scope="module")
def drifts():
    """Largest violations of the rod's length and of its rate in a long run, by remedy."""
    found = {}
    for drift in ("projection", "baumgarte", "raw"):
        scene = pendula.pendulum(formulation="constrained", drift=drift, g=1.0)
        # A loose tolerance, so that step errors, not rounding, make what drifts.
        motion = simulate(scene, LONG, samples=101, rtol=1e-7)
        phi, rates = jax.vmap(scene.system.violation)(motion.ts, motion.ys)
        found[drift] = float(jnp.abs(phi).max()), float(jnp.abs(rates).max())
    return found


@pytest.mark.slow
def test_projection_holds_constraints_for_a_thousand_time_units(drifts):
    assert max(drifts["projection"]) < 1e-12


@pytest.mark.slow
def test_raw_equations_drift_and_baumgarte_holds_them_within_step_errors(drifts):
    assert drifts["raw"][0] > 1e-6
    assert 1e-12 < drifts["baumgarte"][0] < 1e-2 * drifts["raw"][0]


def test_multiplier_is_the_tension_of_the_rod():
    scene = pendula.pendulum(m=2.0, length=1.5, g=3.0, formulation="constrained")
    angles, rates = jnp.array([0.0, 1.0, 3.0]), jnp.array([2.0, -1.0, 0.5])
    for angle, rate in zip(angles, rates, strict=True):
        y = pendula.pendulum(length=1.5, angle=angle, rate=rate, formulation="constrained").y0
        forces = scene.system.constraint_forces(NOW, y, scene.effects)
        assert forces is not None
        (force,) = forces
        tension = 2.0 * (1.5 * rate**2 + 3.0 * jnp.cos(angle))
        assert gap(force, -tension) < EXACT * 20


def test_nearest_start_is_offered():
    scene = linkages.rod_on_line(m=(1.0, 3.0))
    bad = scene.starting([0.0, 1.0, 1.0, 0.0])
    # An impact between the rod's ends keeps momentum: both go on at 1/4.
    with pytest.raises(ValueError, match=r"nearest one that does is \[0.0, 1.0, 0.25, 0.25\]"):
        simulate(bad)
    offered = scene.system.nearest(NOW, bad.y0)
    scene.starting(offered).check()
    stretched = scene.starting([0.0, 1.4, 0.0, 0.0])
    with pytest.raises(ValueError, match=r"a violation of 0.4 in place, 0 in velocity"):
        stretched.check()
    assert gap(scene.system.nearest(NOW, stretched.y0), jnp.array([0.3, 1.3, 0, 0])) < EXACT


@pytest.mark.slow
def test_derivatives_of_a_tied_motion_are_those_of_the_free_one():
    def end(length, formulation):
        scene = pendula.pendulum(length=length, formulation=formulation)
        out = solve(scene, 1.0, rtol=1e-13)
        return scene.system.points(jnp.ones(()), out.y1).r[0]

    tangents = [
        jax.jit(jax.jacfwd(lambda length, f=f: end(length, f)))(jnp.asarray(1.2))
        for f in ("newton_euler", "constrained")
    ]
    assert gap(*tangents) < SOLVED * 10


@pytest.mark.parametrize("drift", ["projection", "baumgarte", "raw"])
def test_nothing_in_a_stepping_loop_keeps_it_from_being_folded(drift):
    scene = pendula.double_pendulum(formulation="constrained", drift=drift)
    used = primitives(scene.rate, NOW, scene.y0) + primitives(scene.field.project, NOW, scene.y0)
    forbidden = {"scatter", "scatter-add", "sort", "lu", "cholesky", "triangular_solve"}
    assert not forbidden & set(used)
    # Small matrix products become custom fusions.
    assert "dot_general" not in used


@pytest.mark.slow
def test_energy_is_kept_by_every_formulation():
    for formulation in ("newton_euler", "lagrange", "constrained"):
        scene = pendula.double_pendulum(formulation=formulation)
        motion = simulate(scene, samples=9, rtol=1e-13)
        assert float(energy.drift(motion)) < 1e-11


def test_misuse_is_refused_with_the_reason():
    with pytest.raises(ValueError, match=r"formulation: expected .* Did you mean 'lagrange'\?"):
        pendula.pendulum(formulation="lagrang")
    with pytest.raises(ValueError, match=r"formulation: expected one of lagrange, newton_euler"):
        sideways.sideways_pendulum(formulation="constrained")
    with pytest.raises(ValueError, match=r"drift: expected .* Did you mean 'projection'\?"):
        pendula.pendulum(formulation="constrained", drift="project").check()
    with pytest.raises(ValueError, match=r"mass: expected > 0, got -1.0"):
        simulate(pendula.pendulum(m=-1.0))
    with pytest.raises(ValueError, match=r"length: expected > 0, got 0.0"):
        simulate(pendula.cart_pendulum(length=0.0))


def test_violation_is_empty_without_ties():
    system = Constrained(pendula.double_pendulum().system.mechanism)
    phi, rates = system.violation(NOW, jnp.array([0.1, 0.2, 0.3, 0.4]))
    assert phi.size == rates.size == 0
    y = np.array([0.1, 0.2, 0.3, 0.4])
    assert gap(system.project(NOW, jnp.asarray(y)), y) == 0.0


def test_a_treatment_of_drift_that_is_none_is_refused_in_every_formulation():
    for formulation in ("lagrange", "constrained"):
        with pytest.raises(ValueError, match=r"^drift: expected one of baumgarte, projection, raw"):
            scenes.bead_on_parabola(formulation=formulation, drift="bogus")
