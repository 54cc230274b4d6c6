"""Notes on scenes: kept where these cannot change, and no longer than they exist."""

import gc

import equinox as eqx
import jax
import numpy as np

from jaxdyn import _records, scenes
from jaxdyn._records import notes_on


def test_notes_are_kept_with_a_scene_whose_numbers_cannot_change():
    scene = scenes.cannonball()
    notes_on(scene)["asked"] = "answer"
    assert notes_on(scene) == {"asked": "answer"}
    assert notes_on(scene.starting(scene.y0)) == {}
    before = len(_records._noted._known)
    del scene
    gc.collect()
    assert len(_records._noted._known) < before


def test_there_are_none_on_numbers_that_may_change():
    scene = scenes.cannonball()
    assert notes_on(eqx.tree_at(lambda s: s.y0, scene, np.array(scene.y0))) is None
    traced = []
    jax.make_jaxpr(lambda s: traced.append(notes_on(s)))(scene)
    assert traced == [None]
