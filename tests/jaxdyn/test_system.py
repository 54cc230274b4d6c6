"""Records are equinox modules whose attributes and methods are those of Python."""

import dataclasses
import types
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest
from helpers import EXACT, gap
from jaxtyping import Array

from jaxdyn import Effect, System, scenes
from jaxdyn._checks import as_float
from jaxdyn.system import Record


class Pair(Record):
    first: Array = eqx.field(converter=as_float)
    second: Array = eqx.field(converter=as_float, default=2.0)
    name: str = eqx.field(static=True, default="")

    def total(self):
        return self.first + self.second


class ByHand(Record):
    value: float
    other: float

    def __init__(self, value, *, twice=False, forgets=False):
        self.value = value
        if twice:
            self.value = 2.0
        if not forgets:
            self.other = 0.0


class Positive(Record):
    value: float

    def __check_init__(self):
        if self.value <= 0:
            raise ValueError("not positive")


class Unsaid(Record):
    value: eqx.AbstractVar[float]


def test_a_record_is_an_equinox_module():
    pair = Pair(1.0, name="a")
    assert isinstance(pair, eqx.Module)
    assert isinstance(pair.first, jax.Array)  # converted
    assert len(jax.tree.leaves(pair)) == 2
    doubled = jax.tree.map(lambda x: 2 * x, pair)
    assert (type(doubled), doubled.name, float(doubled.total())) == (Pair, "a", 6.0)
    assert float(jax.jit(jax.grad(Pair.total))(pair).first) == 1.0
    moved = eqx.tree_at(lambda p: p.second, pair, jnp.asarray(5.0))
    assert float(moved.total()) == 6.0
    renamed = dataclasses.replace(pair, name="b")
    assert (renamed.name, jax.tree.structure(renamed) == jax.tree.structure(pair)) == ("b", False)
    lanes = jax.vmap(Pair)(jnp.arange(3.0))
    assert lanes.first.shape == (3,)


def test_methods_are_those_of_python():
    pair = Pair(1.0)
    assert type(pair.total) is types.MethodType
    scene = scenes.three_body()
    rate = jax.jit(scene.rate)(0.0, scene.y0)  # hashable, unlike those of equinox
    assert gap(rate, scene.rate(jnp.zeros(()), scene.y0)) < EXACT


def test_a_record_is_frozen():
    pair = Pair(1.0)
    for name in ("first", "name", "unknown"):
        with pytest.raises(dataclasses.FrozenInstanceError, match=name):
            setattr(pair, name, 1.0)
    with pytest.raises(dataclasses.FrozenInstanceError, match="value"):
        ByHand(1.0, twice=True)
    with pytest.raises(TypeError, match="ByHand has no value for other"):
        ByHand(1.0, forgets=True)


def test_what_equinox_checks_is_checked():
    assert Positive(1.0).value == 1.0
    with pytest.raises(ValueError, match="not positive"):
        Positive(-1.0)
    with pytest.raises(TypeError, match="Unsaid has no value for value"):
        Unsaid()
    abstract: Any = System
    with pytest.raises(TypeError, match="abstract"):
        abstract()


def test_effects_of_users_may_check_themselves():
    class Even(Effect):
        n: int = eqx.field(static=True)

        def __check_init__(self):
            if self.n % 2:
                raise ValueError("odd")

        def force(self, t, r, v, m):
            return r

    assert Even(2).n == 2
    with pytest.raises(ValueError, match="odd"):
        Even(3)
