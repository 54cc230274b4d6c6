"""What `print` shows of scenes, motions and results: their numbers, in a few lines, always."""

import dataclasses
import re
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn import Scene, _text, effects, ensemble, scenes, simulate, solve, until
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.events import Reaches
from jaxdyn.integrate.phase import END, Exit, HybridTrajectory, Phase
from jaxdyn.integrate.phases import simulate_phases
from jaxdyn.scenes.catalogue import entries
from jaxdyn.solvers import RK4

#: What Equinox prints of arrays, which a text of ours never has.
SHAPES = re.compile(r"\b[fi]\d\d\[")
QUICK = {"samples": 5, "solver": RK4, "dt": 0.1}


def lines(x) -> list[str]:
    """The lines that are printed of something."""
    text = str(x)
    assert text == repr(x)
    assert not SHAPES.search(text)
    found = text.split("\n")
    assert max(map(len, found)) <= 100
    return found


@pytest.mark.parametrize("name", entries())
def test_every_ready_made_scene_is_shown_with_its_numbers(name):
    scene = entries()[name].make()
    head, *rows = lines(scene)
    assert (head, len(rows) <= 12) == (f"Scene {name}", True)
    text = " ".join(" ".join(rows).split())
    assert f"span {float(scene.t1):.6g}" in text
    (first, unit), y = scene.labels()[0], float(scene.y0[0]) + 0.0
    assert f"start {first} = {y:.6g}{'' if unit == '1' else ' ' + unit}" in text
    for part in (scene.system, *scene.effects):
        assert f"{type(part).__name__}(" in text


def test_numbers_have_the_units_of_their_class():
    assert _text.record(effects.UniformGravity(9.81)) == "UniformGravity(g = 9.81 m/s^2)"
    spring = effects.Spring(10.0, 0.5, j=1)
    assert _text.record(spring) == "Spring(k = 10 N/m, length = 0.5 m, anchor = 0 m, j = 1)"
    # Alone they have none, since only the scene knows its units.
    assert lines(spring) == ["Spring(k = 10, length = 0.5, anchor = 0, j = 1)"]
    days = scenes.n_body(units=("AU", "Msun", "day"))
    assert str(days.effects[0]) == "PairGravity(G = 0.000295912)"
    assert str(days.system) == "FreePoints(m = (1, 1, 0.3), d = 3)"
    assert "PairGravity(G = 0.000295912 AU^3/(Msun day^2))" in str(days)
    # A world without units has none.
    assert "PairGravity(G = 1)" in str(scenes.three_body())
    assert "PairGravity(G = 10 m^3/(kg s^2))" in str(scenes.three_body_circular())


def test_a_large_scene_is_shown_in_a_few_lines():
    scene = Scene(FreePoints(np.ones(1000)), (effects.UniformGravity(),), y0=np.arange(4000.0))
    found = lines(scene)
    assert "shape (1000,)" in found[1]
    assert len(found) < 8
    assert "and 3988 more" in found[-2]


def test_what_is_being_traced_is_shown_too():
    seen = []

    def end(angle):
        scene = scenes.pendulum(angle=angle)
        motion = simulate(scene, 1.0, **QUICK)
        seen.extend(map(repr, (scene, motion, effects.UniformGravity(angle))))
        return motion.ys[-1, 0]

    jax.jit(jax.grad(end))(1.0)
    jax.vmap(end)(jnp.ones(2))
    for mass, (scene, motion, effect) in {"traced": seen[:3], "1 kg": seen[3:]}.items():
        assert f"Stick(m = {mass}" in scene
        assert "start    shape (2,)" in scene
        assert motion == "Trajectory of pendulum\n  samples  5, traced"
        assert effect == "UniformGravity(g = traced)"
    jax.jit(lambda scene: seen.append(repr(scene)))(scenes.pendulum())
    assert "Stick(m = traced, l = traced" in seen[-1]


def test_a_batch_says_what_it_is():
    def swing(angle):
        return simulate(scenes.pendulum(angle=angle), 1.0 + angle, **QUICK)

    batch = jax.vmap(swing)(jnp.array([0.0, 1.0, 2.0]))
    assert lines(batch) == [
        "Trajectory of pendulum",
        "  batch    of shape (3,)",
        "  span     0 to 1 to 3 s",
        "  samples  5",
        "  steps    10 to 30 accepted, 0 rejected",
        "  status   3 of 3 OK",
    ]
    assert lines(batch.scene)[:2] == ["Scene pendulum", "  batch    of shape (3,)"]
    assert "g = (9.81, 9.81, 9.81) m/s^2" in str(batch.scene)
    lost = eqx.tree_at(lambda motion: motion.status, batch, jnp.array([0, 1, 0]))
    assert "2 of 3 OK, the worst STEP_LIMIT: The integration stopped" in str(lost)


def test_what_has_no_numbers_is_shown_by_its_shapes():
    motion = simulate(scenes.pendulum(), 1.0, **QUICK)
    for tree in (motion, motion.scene):
        shapes = jax.eval_shape(lambda tree=tree: tree)
        parted = eqx.partition(tree, eqx.is_array)[1]
        assert type(tree).__name__ in repr(shapes)
        assert type(tree).__name__ in repr(parted)
    # Equinox's own text is still there.
    assert "Trajectory(" in eqx.tree_pformat(motion)
    assert "f64[5,2]" in eqx.tree_pformat(motion)


def test_a_chain_is_shown_by_its_phases():
    leg = Phase(scenes.cannonball(angle=1.0), (Exit(Reaches(1, 0.0, -1), END),))
    chain = simulate_phases({"fly": leg}, "fly", leg.scene.y0, 9.0, samples=3)
    head, fly, status, *end = lines(chain)
    assert (head, fly) == (
        "HybridTrajectory of 1 phase",
        f"  fly     0 to {20 * np.sin(1.0) / 9.81:.6g} s",
    )
    assert status == "  status  OK: Phase fly led to the end."
    assert "".join(end).startswith(f"  end     x = {200 * np.sin(1) * np.cos(1) / 9.81:.6g} m, y")
    many = HybridTrajectory(
        chain.names * 20, chain.pieces * 20, chain.t, chain.y, True, chain.status, ()
    )
    # Its path is empty, so that nothing can be said of its end; it is shown all the same.
    assert "HybridTrajectory" in repr(many)
    shown = lines(dataclasses.replace(many, path=chain.path))
    assert (len(shown), shown[5]) == (12, "  ...     12 more")


@pytest.mark.slow
def test_results_are_shown_by_their_fields():
    scene = scenes.pendulum(g=4.0)
    flow = solve(scene, 1.0, solver=RK4, dt=0.5)
    assert lines(flow)[0] == "SolveResult"
    assert "  steps     2" in lines(flow)
    assert "  status    OK" in lines(flow)
    assert "  status    STEP_LIMIT" in lines(solve(scene, 1.0, max_steps=1))
    stop = until(scenes.oscillator(), Reaches(0, 0.5))
    assert "  t           1.0472" in lines(stop)
    assert "  status      OK" in lines(stop)
    ends = ensemble.run(scenes.oscillator(), np.ones((9, 2)), 1.0, chunk=9, threads=1)
    assert lines(ends)[:2] == ["Ends", "  y1        shape (9, 2)"]
    assert "9 motions: The integration reached its end." in lines(ends)[-1]
    assert "  status    9 OK" in lines(ends)
    modes = jaxdyn.modes(scene, jnp.zeros(2))
    assert lines(modes)[:2] == ["Modes", "  squares    (4,) rad^2/s^2"]


@pytest.mark.slow
def test_stops_of_a_batch_are_shown_with_how_often_each_end_occurs():
    def stop(x):
        swing = scenes.oscillator()
        return until(swing.starting(jnp.stack([x, 0.0]), 10.0), Reaches(0, 0.5))

    shown = lines(jax.vmap(stop)(jnp.array([1.0, 0.1, 2.0, jnp.nan])))
    assert "  status      3 OK, 1 NOT_FINITE" in shown
    text = " ".join(" ".join(shown).split())
    assert "message 1 motion: no event. 2 motions: event 0. 1 motion: The start, its rate" in text


class Mixed(NamedTuple):
    """Numbers of many kinds: a mass m [kg]."""

    m: float
    table: np.ndarray
    inner: dict
    none: None
    z: complex


def test_numbers_of_all_kinds_are_written():
    found = _text.fields(Mixed(-0.0, np.zeros((3, 3)), {"a": (1, 2.5)}, None, 1 - 2j))
    assert found.split("\n") == [
        "Mixed",
        "  m      0 kg",
        "  table  shape (3, 3)",
        "  inner  {a: (1, 2.5)}",
        "  z      1-2j",
    ]
    assert _text.extent(np.array([np.nan, 2.0, 3.0])) == "2 to 3"
    assert _text.extent(np.array([np.nan])) == "nan"
