"""Motions in JAX's default of 32-bit floats: where few digits are asked for, with a warning."""

import functools
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import run_python
from narrow import MOTIONS

import jaxdyn
import orbits
from jaxdyn import ensemble, scenes
from jaxdyn.integrate import events, phases

_REFUSED = r"^floats: expected 64-bit floats, got JAX's default of 32 bits\. Call jaxdyn\.conf"
_WARNED = "32-bit floats: about five digits of a motion are right over some periods"
#: Relative to the size of each entry: rounding of 6e-8, in up to 600 steps.
MOST = 5e-5
ENDED = "pushed_particle"


@functools.cache
def narrow():
    """All motions in 32-bit floats, from one process."""
    return json.loads(run_python(f"import narrow; narrow.show({list(MOTIONS)}, 1e-6)"))


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(MOTIONS.keys() - {ENDED}))
def test_four_digits_are_right_over_some_periods(name):
    found, expected = narrow()[name], MOTIONS[name](1e-12)
    assert found["type"] == "float32"
    assert [text[: len(_WARNED)] for text in found["warned"]] == [_WARNED]
    sizes = np.abs(expected).max(axis=0)
    sizes = np.maximum(sizes, 1e-3 * sizes.max())  # of entries that stay at 0
    assert (np.abs(np.array(found["values"]) - expected) / sizes).max() < MOST


@pytest.mark.slow
def test_a_force_that_begins_to_act_on_a_test_particle_ends_the_motion_in_32_bits():
    assert np.isnan(np.array(narrow()[ENDED]["values"], float)[-1]).any()


def _ball():
    return scenes.cannonball()


@pytest.mark.filterwarnings("ignore:32-bit floats")  # of a scene that is refused later
@pytest.mark.parametrize(
    "call",
    [
        lambda: jaxdyn.simulate(_ball()),
        lambda: jaxdyn.simulate(_ball(), rtol=9e-7),
        lambda: jaxdyn.simulate(_ball(), digits=5),
        lambda: jaxdyn.solve(_ball(), 1.0),
        lambda: jax.jit(lambda rtol: jaxdyn.solve(_ball(), 1.0, rtol=rtol).y1)(1e-6),
        lambda: ensemble.run(_ball(), _ball().y0[None], 1.0),
        lambda: jaxdyn.until(_ball(), events.Reaches(1, 0.0), 9.0, rtol=1e-6),
        lambda: jaxdyn.crossings(_ball(), events.Reaches(1, 0.0), 9.0, rtol=1e-6),
        lambda: phases.simulate_phases(
            {"fly": phases.Phase(_ball(), ())}, "fly", _ball().y0, 1.0, rtol=1e-6
        ),
        lambda: jaxdyn.equilibria(scenes.pendulum(), [-1.0, -1.0], [1.0, 1.0]),
        lambda: jaxdyn.linearize(scenes.pendulum(angle=0.0), jnp.zeros(2)),
        lambda: jaxdyn.modes(scenes.pendulum(angle=0.0)),
        lambda: jaxdyn.lyapunov_exponents(scenes.lorenz(), 1.0),
        lambda: jaxdyn.equations(scenes.pendulum()),
        lambda: jaxdyn.vibration.modes(scenes.pendulum(angle=0.0)),
        lambda: jaxdyn.simulate(scenes.four_bar(), rtol=1e-6),
        lambda: jaxdyn.simulate(scenes.top(), rtol=1e-6),
        lambda: orbits.find(scenes.pendulum(), period=2.0),
        lambda: orbits.frequency_response(scenes.oscillator(x=0.0), "x", (0.5, 1.5)),
        lambda: orbits.backbone(scenes.pendulum(angle=0.0)),
        lambda: orbits.section(scenes.henon_heiles(), events.Reaches(0, 0.0)),
    ],
)
def test_what_needs_digits_is_refused(call):
    with jax.enable_x64(False), pytest.raises(ValueError, match=_REFUSED):
        call()
