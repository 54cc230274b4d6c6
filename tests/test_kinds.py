"""Public functions refuse a first argument of another kind by name, and say what to call first."""

import random

import numpy as np
import pytest

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn._checks import check_kind
from jaxdyn.gallery.reference import _public

FUNCTIONS = {name: thing for name, thing in _public() if getattr(thing, "first_kinds", ())}
SCENE = scenes.oscillator(k=1.0, x=1.0)
EQUILIBRIA = jaxdyn.continuation.EquilibriumFamily((), (), "", lambda k: SCENE)


@pytest.fixture(scope="module")
def given():
    """One thing of every kind that people have at hand."""
    return {
        "None": None,
        "number": 3,
        "huge number": 10**400,
        "text": "orbit",
        "list": [],
        "array": np.zeros(4),
        "dictionary": {"a": 1.0},
        "function": scenes.oscillator,
        "class": jaxdyn.Scene,
        "scene": SCENE,
        "system": SCENE.system,
        "effect": SCENE.effects[0],
        "motion": jaxdyn.simulate(SCENE, 1.0, samples=3),
        "orbit": orbits.find(SCENE, period=6.3),
        "status": jaxdyn.Status.OK,
    }


def test_most_public_functions_are_covered():
    assert len(FUNCTIONS) > 120
    assert {"orbits.stability", "jaxdyn.simulate", "jaxdyn.analysis.energy.drift"} <= {*FUNCTIONS}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_another_kind_is_refused_by_name(name, given):
    function = FUNCTIONS[name]
    rest = random.Random(name).sample([None, 1.0, "x", [], (), {}], 2)
    for x in given.values():
        if isinstance(x, function.first_kinds):
            continue
        for args in ((x,), (x, rest[0]), (x, *rest)):
            with pytest.raises(ValueError, match=r"expected an? \w+|expected a list"):
                function(*args)


REMEDIES = [
    (
        lambda: orbits.stability(SCENE),
        r"^orbit: expected an Orbit or a HybridOrbit, got a Scene\. Find one first:",
    ),
    (lambda: orbits.find(orbits.find(SCENE, period=6.3)), r"got an Orbit\. Pass orbit\.scene\."),
    (lambda: jaxdyn.simulate(jaxdyn.simulate(SCENE, 1.0)), r"got a Trajectory\. Pass motion\.sc"),
    (lambda: jaxdyn.energy_change(SCENE), r"got a Scene\. Simulate it first: jaxdyn\.simulate"),
    (lambda: jaxdyn.solve(scenes.pendulum, 1.0), r"got pendulum\. Call it: pendulum\(\)\."),
    (lambda: jaxdyn.until(3.0, None), r"^scene: expected a Scene, got 3\.0\.$"),
    (
        lambda: orbits.switch_branch(EQUILIBRIA, None),
        r"got an EquilibriumFamily\. Equilibria have jaxdyn\.continuation\.switch_branch and",
    ),
    (
        lambda: jaxdyn.continuation.switch_branch(orbits.families.Family((), (), "", None), None),
        r"got a Family\. Orbits have orbits\.switch_branch and",
    ),
    (lambda: jaxdyn.drawing.trajectory([SCENE]), r"^motion\[0\]: .*, got a Scene\. Simulate it"),
]


@pytest.mark.parametrize(("call", "message"), REMEDIES)
def test_the_message_says_what_to_call(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_a_keyword_is_checked_too():
    with pytest.raises(ValueError, match=r"^scene: expected a Scene"):
        jaxdyn.simulate(scene=None)
    with pytest.raises(TypeError, match="missing 1 required positional"):
        jaxdyn.simulate()
    check_kind("scene", SCENE, (jaxdyn.Scene,))
