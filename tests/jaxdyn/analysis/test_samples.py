"""Questions about the samples of a motion: numbers of samples share programs."""

import equinox as eqx
import jax
import numpy as np
import pytest
from helpers import EXACT

from jaxdyn import scenes, simulate
from jaxdyn.analysis import constraints, energy, momenta, precession
from jaxdyn.analysis.energy_change import energy_change
from jaxdyn.effects import LinearDrag
from jaxdyn.scenes.satellites import antenna_trace


def hanging(n):
    """A rod with drag, whose motion every question here has an answer for."""
    scene = scenes.pendulum(formulation="constrained") + LinearDrag(0.1)
    return simulate(scene, 2.0, samples=n)


def turning(n):
    return simulate(scenes.satellite("B"), 1.0, samples=n)


def leaning(n):
    return simulate(scenes.feynman_plate(), 1.0, samples=n)


#: Each with a row for each sample, or with one number for all.
QUESTIONS = {
    "positions": (hanging, lambda motion: motion.r),
    "drift": (hanging, energy.drift),
    "drift of another": (hanging, lambda motion: energy.drift(motion, "angular momentum")),
    "along": (hanging, lambda motion: energy.along(energy.energy, motion)),
    "reactions": (hanging, constraints.reactions),
    "tensions": (hanging, constraints.tensions),
    "moments": (hanging, lambda m: momenta.moment_balance(m, momenta.centre_of_mass)),
    "powers": (hanging, lambda m: momenta.power_balances(m, LinearDrag)),
    "wobble": (leaning, precession.wobble_and_spin),
    "tilts": (turning, precession.tilts),
    "antenna": (turning, lambda motion: antenna_trace(motion, "B")),
}
ON_THE_HOST = QUESTIONS | {"energy_change": (hanging, lambda motion: energy_change(motion).works)}


@pytest.mark.sample("drift of another", "along")
@pytest.mark.parametrize("name", ON_THE_HOST)
def test_another_number_of_samples_compiles_nothing(name, caplog):
    make, question = ON_THE_HOST[name]
    motions = [make(n) for n in (70, 201, 202)]
    question(motions[0])
    with jax.log_compiles(), caplog.at_level("WARNING"):
        for motion in motions[1:]:
            question(motion)
    assert [record.message for record in caplog.records if "Compiling" in record.message] == []


@pytest.mark.sample("drift", "drift of another", "along")
@pytest.mark.parametrize("name", QUESTIONS)
def test_samples_that_fill_an_array_up_change_no_answer(name):
    make, question = QUESTIONS[name]
    motion = make(50)
    shared, alone = question(motion), eqx.filter_jit(question)(motion)
    assert jax.tree.structure(shared) == jax.tree.structure(alone)
    for one, other in zip(jax.tree.leaves(shared), jax.tree.leaves(alone), strict=True):
        assert one.shape == other.shape
        size = max(1.0, float(np.max(np.abs(other))))
        assert np.max(np.abs(np.asarray(one, float) - np.asarray(other, float))) < EXACT * size
