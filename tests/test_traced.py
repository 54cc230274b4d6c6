"""Functions that run on the host, called inside of jax.jit and jax.grad: each says so.

Inside of `jax.jit` whatever is computed is traced, also from numbers that are not.
"""

from typing import Any

import jax
import numpy as np
import pytest

import jaxdyn
import orbits
from jaxdyn import chaos, drawing, ensemble, player, scenes, symbolic, vibration
from jaxdyn.analysis.free_body import free_body
from jaxdyn.continuation import EquilibriumFamily
from orbits import Orbit, Outcome

OMEGA = np.linspace(1.0, 2.0, 3)
GRID = {"theta": np.array([-1.0, 1.0]), "theta_dot": np.array([0.0, 1.0])}


def swing(length):
    return scenes.pendulum(length=length, angle=1.0)


def motion(length):
    return jaxdyn.simulate(swing(length), 1.0, samples=4)


def orbit(length):
    return Orbit(swing(length), orbits.PLAIN, 0.0, Outcome.FOUND, 0, 1e-13)


def of(length):
    return lambda g: scenes.pendulum(length=length, g=g)


HOPF: Any = None  # the trace is noticed before
NO_FAMILY = EquilibriumFamily((), (), "", of(1.0))


ON_HOST = {
    "animate": lambda x: drawing.animate(motion(x), "a.gif"),
    "bode": lambda x: drawing.bode(OMEGA, vibration.receptance(swing(x), "theta", "theta", OMEGA)),
    "free body": lambda x: drawing.free_body(swing(x)),
    "free_body": lambda x: free_body(swing(x)),
    "time_series": lambda x: drawing.time_series(motion(x)),
    "trajectory": lambda x: drawing.trajectory(motion(x)),
    "play": lambda x: motion(x).play(),
    "live": lambda x: swing(x).live(),
    "player.live": lambda x: player.live({"one": swing(x)}),
    "frequencies": lambda x: chaos.frequencies(motion(x), "theta"),
    "gali": lambda x: chaos.gali(swing(x), count=2),
    "megno": lambda x: chaos.megno(swing(x)),
    "megno from there": lambda x: chaos.megno(swing(1.0), x * np.ones((2, 2))),
    "sali": lambda x: chaos.sali(swing(x)),
    "stream": lambda x: list(ensemble.stream(swing(x), [np.ones((2, 2))], 1.0)),
    "fit": lambda x: jaxdyn.fit(of(x), {"g": 9.0}, {"t": OMEGA, "theta": OMEGA}),
    "noise": lambda x: jaxdyn.fit(of(1.0), {"g": 9.0}, {"t": OMEGA, "theta": OMEGA}, noise=x),
    "continue_equilibria": lambda x: jaxdyn.continue_equilibria(of(x), 9.81, [0.0, 0.0]),
    "basins": lambda x: orbits.basins(swing(x), GRID),
    "basin_fractions": lambda x: orbits.basin_fractions(lambda g: None, [x]),
    "map_basins": lambda x: orbits.map_basins(lambda y: [x * y[0]], {"x": OMEGA}),
    "params of a map": lambda x: orbits.map_basins(lambda y, p: p * y, {"x": OMEGA}, params=x),
    "continue_family": lambda x: orbits.continue_family(orbit(1.0), of(x), 9.81),
    "from_hopf": lambda x: orbits.from_hopf(NO_FAMILY, HOPF, amplitude=x),
    "search_near": lambda x: orbits.search_near(swing(x)),
    "equations": lambda x: jaxdyn.equations(swing(x)),
    "code": lambda x: symbolic.code(swing(x), "python"),
}


@pytest.mark.parametrize("transform", [jax.jit, jax.grad])
@pytest.mark.parametrize("name", ON_HOST)
def test_what_runs_on_the_host_is_refused_inside_of_traces(name, transform):
    with pytest.raises(ValueError, match=r"traced") as raised:
        transform(ON_HOST[name])(1.0)
    assert type(raised.value) is ValueError  # those of JAX are ValueErrors of other types
    # What to do instead: to be called outside, or something else that has derivatives.
    remedies = ("utside", "compiled function", "differentiable", "params", "jax.vmap")
    assert any(x in str(raised.value) for x in remedies)


@pytest.mark.slow
def test_designs_are_sought_outside_of_traces():
    found = orbits.find(swing(1.0), period=2.2, hold="theta")

    def period(wanted):
        def off(one):
            return one.period - wanted

        return orbits.design(lambda p: swing(p[0]), off, [1.0], found, hold="theta").numbers[0]

    def length(g):
        def make(p):
            return scenes.pendulum(length=p[0], g=g, angle=1.0)

        return orbits.design(make, lambda x: x.period - 2.0, [1.0], found, hold="theta").numbers[0]

    for name, sought, at in (("wanted", period, 2.0), ("make", length, 9.81)):
        with pytest.raises(ValueError, match=f"^{name}: .*traced by jit, grad.* outside"):
            jax.grad(sought)(at)
        with pytest.raises(ValueError, match=r"^design: .*traced by jit, grad.* outside"):
            jax.jit(sought)(at)


def test_a_family_that_captured_a_traced_number_says_what_has_derivatives():
    def fold(length):
        return jaxdyn.continue_equilibria(of(length), 9.81, [0.0, 0.0]).special[0].parameter

    with pytest.raises(
        ValueError, match=r"captured values that are traced.*differentiable"
    ) as raised:
        jax.grad(fold)(1.0)
    assert "orbits.differentiable" in str(raised.value)
    assert callable(orbits.differentiable)
