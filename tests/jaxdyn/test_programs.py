"""Programs of JAX are read as every version writes them; one of an unknown form is left alone."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxdyn import _programs
from jaxdyn.solvers.formulas import formulas
from jaxdyn.solvers.formulas.formulas import simplify


def looped(y):
    def body(carry, row):
        return carry * row, carry + y[0]

    last, rows = lax.scan(body, y[1], jnp.array([2.0, 3.0]), reverse=True)
    return jnp.stack([last, rows[0]])


def the_loop():
    (eqn,) = (e for e in jax.make_jaxpr(looped)(jnp.ones(2)).eqns if e.primitive.name == "scan")
    return eqn


def test_the_loop_of_this_version_is_known():
    found = _programs.loop(the_loop())
    assert found is not None
    assert (found.length, found.reverse, found.consts, found.carry) == (2, True, 1, 1)


def test_loops_are_known_by_numbers_and_by_trees():
    shared = {"jaxpr": None, "length": 5, "reverse": False}
    parts = [None] * 3, [None] * 2, [None]
    trees = SimpleNamespace(unpack=lambda: parts)
    for counted in ({"num_consts": 3, "num_carry": 2}, {"ft_in": trees}):
        found = _programs.loop(SimpleNamespace(params=shared | counted))
        assert found == _programs.Loop(None, 5, False, 3, 2)


def test_a_loop_of_an_unknown_version_is_evaluated_as_it_stands(monkeypatch):
    for unknown in ({}, {"ft_in": None}, {"num_consts": 1}):
        assert _programs.loop(SimpleNamespace(params=unknown)) is None
    monkeypatch.setattr(formulas, "loop", lambda eqn: None)
    y = jnp.array([0.3, 0.7])
    found = simplify(lambda t, y: looped(y))
    assert "scan" in str(jax.make_jaxpr(found)(0.0, y))
    np.testing.assert_allclose(found(0.0, y), [6 * 0.7, 3 * 0.7 + 0.3], rtol=1e-15)
