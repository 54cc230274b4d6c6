"""Records are pickled and copied with their functions, lambdas among them."""

import copy
import pickle
import sys

import numpy as np
import pytest

import jaxdyn
from jaxdyn import scenes
from jaxdyn.integrate import events

K = 2.0


def _named(t, y):
    return -K * y


def _inner():
    factor = 2.0
    return lambda t, y: -factor * y


RATES = {"named": _named, "lambda": lambda t, y: -2.0 * y, "inner": _inner()}
COPIES = {"pickle": lambda x: pickle.loads(pickle.dumps(x)), "copy": copy.deepcopy}


@pytest.mark.sample("lambda-pickle", "inner-copy")
@pytest.mark.parametrize("again", COPIES.values(), ids=COPIES.keys())
@pytest.mark.parametrize("rate", RATES.values(), ids=RATES.keys())
def test_a_scene_comes_back_with_its_function(rate, again):
    scene = jaxdyn.ode(rate, [1.0], integrals={"twice": lambda t, y: 2 * y[0]})
    motion = jaxdyn.simulate(scene, samples=2, rtol=1e-13)
    back = again(motion)
    assert back.ys.tolist() == motion.ys.tolist()
    assert back.scene.system.captured == scene.system.captured
    assert abs(jaxdyn.solve(back.scene, 1.0, rtol=1e-13).y1[0] - np.exp(-2.0)) < 1e-12
    assert back.scene.system.integrals(0.0, back.ys[0])["twice"] == 2.0


def test_an_event_comes_back():
    event = pickle.loads(pickle.dumps(events.When(lambda t, y: y[0] - 0.5)))
    stop = jaxdyn.until(scenes.oscillator(k=1.0, x=1.0), event, 3.0)
    assert abs(stop.t - np.arccos(0.5)) < 1e-9


def test_a_number_that_differs_where_it_is_read_is_noticed(monkeypatch):
    stored = pickle.dumps(jaxdyn.ode(_named, [1.0]))
    monkeypatch.setitem(globals(), "K", 3.0)
    with pytest.raises(ValueError, match="another value of 'K'"):
        jaxdyn.solve(pickle.loads(stored), 1.0)


def test_the_package_that_stores_lambdas_may_be_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "cloudpickle", None)
    with pytest.raises(ValueError, match=r"^pickle: .*that have a name, got .*Define it by `def`"):
        pickle.dumps(jaxdyn.ode(RATES["lambda"], [1.0]))
    assert pickle.loads(pickle.dumps(jaxdyn.ode(_named, [1.0]))).y0 == 1.0
