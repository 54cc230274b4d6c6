"""Rods and linkages against closed forms and conservation laws."""

import math

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import refusal

from jaxdyn import scenes
from jaxdyn.scenes import linkages

NOW = jnp.zeros(())


def test_links_that_cannot_close_are_refused():
    with pytest.raises(
        ValueError, match=r"length: expected links that can close, got a longest side"
    ):
        linkages.four_bar(length=(1.0, 1.0, 5.0))
    with pytest.raises(ValueError, match=r"links that can close.*Shorten the longest link"):
        linkages.pinned_chain(span=4.5)
    with pytest.raises(ValueError, match=r"length: expected > 0, got 0"):
        scenes.dumbbell(length=0.0)
    with pytest.raises(ValueError, match=r"angles: expected shape \(4,\)"):
        linkages.pinned_chain(angles=(1.0,))
    with pytest.raises(ValueError, match=r"rates: expected shape \(3,\)"):
        linkages.skate_chain(rates=(1.0,))
    with pytest.raises(ValueError, match=r"Did you mean 'loop'\?"):
        linkages.pinned_chain(formulation="lop")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: scenes.pinned_chain(span=9.0), "span: expected links that can close"),
        (lambda: scenes.pinned_chain(span=4.0), "span: expected links that can close"),
        (lambda: scenes.pinned_chain(span=math.nan), "span: expected finite numbers, got nan"),
        (lambda: scenes.four_bar(ground=9.0), "ground: expected links that can close"),
        (lambda: scenes.four_bar(length=(9.0, 1.0, 1.0)), "length: expected links that can close"),
        (
            lambda: scenes.four_bar(ground=4.5, angle=0.0),
            "angle: expected an angle of the crank at which coupler and rocker reach",
        ),
    ],
)
def test_an_invalid_start_is_refused_by_name(make, message):
    assert refusal(make).startswith(message)


def test_a_chain_that_can_just_close_is_taken():
    near = scenes.pinned_chain(span=3.9, angles=(1.4, 1.5, 1.6, 1.7))
    np.testing.assert_allclose(near.system.violation(0.0, near.y0)[0], 0.0, atol=1e-12)
