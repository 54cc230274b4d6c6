"""The tests check shapes that annotations name, and let no dtypes meet without a conversion."""

import jax
import jax.numpy as jnp
import pytest
from jaxtyping import TypeCheckError

from jaxdyn import scenes
from jaxdyn._numerics import safe_norm
from jaxdyn.geometry.vectors import cross_by_indices


def test_a_wrong_shape_is_seen_where_it_enters():
    with pytest.raises(TypeCheckError, match="'x'"):
        safe_norm(jnp.zeros(()))
    with pytest.raises(TypeCheckError, match="'y'"):
        scenes.pendulum().rate(jnp.zeros(()), jnp.zeros((1, 2)))


def test_functions_keep_their_names_and_take_lists():
    assert cross_by_indices.__name__ == "cross_by_indices"
    assert cross_by_indices([1, 0, 0], [0, 1, 0]).tolist() == [0, 0, 1]


def test_nothing_is_promoted_in_silence():
    with pytest.raises(jax.dtypes.TypePromotionError):
        _ = jnp.ones(2) * jnp.arange(2)
    with pytest.raises(ValueError, match="rank"):
        _ = jnp.ones(2) * jnp.ones((2, 2))
