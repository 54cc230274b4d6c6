"""A scene in a file: the classes that its record may name, and whether it is a scene that runs."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxdyn import effects, scenes
from jaxdyn._text import fail
from jaxdyn.files import records
from jaxdyn.formulations.attitude import Attitude
from jaxdyn.formulations.mechanism import Mechanism
from jaxdyn.geometry.inertia import MaterialPoints
from jaxdyn.scene import Effect, Scene, System
from jaxdyn.scenes.drawings import Angles
from jaxdyn.sketch import Looks

#: Modules of the classes that a file may name, looked up among those that are loaded.
LOADED = (effects, scenes)
#: Base classes of the parts of a scene.
KINDS = (System, Effect, Mechanism, Attitude, MaterialPoints, Looks, Angles)


def decode(record: Any, remedy: str) -> Scene:
    """The scene that `records.encode` was given.

    Args:
      record: from a file.
      remedy: what to do if it is none, for the message.
    Raises:
      ValueError: it is not the record of a scene, names an unknown class, or has invalid numbers.
    """
    scene = records.decode(record, "scene", KINDS)
    if not isinstance(scene, Scene):
        raise fail("scene", "a Scene", type(scene).__name__, remedy)
    if not scene.name.isprintable():
        raise fail("name", "a printable text", repr(scene.name)[:40], remedy)
    if np.shape(scene.t1):
        raise fail("t1", "one number", f"shape {np.shape(scene.t1)}", remedy)
    scene.check()
    rate = scene.rate(jnp.zeros(()), scene.y0)
    if rate.shape != scene.y0.shape:
        raise fail("scene", f"a rate of shape {scene.y0.shape}", f"shape {rate.shape}", remedy)
    return scene
