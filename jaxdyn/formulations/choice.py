"""One mechanism in several formulations: the system and the start for the chosen one.

A mechanism is given once, by free coordinates. Any other description (cartesian coordinates with
rods, bodies with hinges, an open chain with a constraint that closes it) is an `Embedding`: the
mechanism with constraints, and the map from the free coordinates to its own. The start follows from
this map and its derivative, so all formulations start in the same pose to rounding.
"""

from collections.abc import Callable, Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import floats
from jaxdyn.formulations.constrained import DRIFTS, Constrained
from jaxdyn.formulations.lagrange import Lagrange
from jaxdyn.formulations.mechanism import Embedding, Mechanism
from jaxdyn.formulations.newton_euler import NewtonEuler
from jaxdyn.scene import System

_FREE = {"newton_euler": NewtonEuler, "lagrange": Lagrange}


def route(
    formulation: str,
    free: Mechanism,
    q,
    v,
    embeddings: Mapping[str, Embedding],
    drift: str = "projection",
) -> tuple[System, Array]:
    """The system of the chosen formulation, and its start at t = 0.

    Args:
      formulation: "newton_euler", "lagrange", or the name of an embedding.
      free: the mechanism in free coordinates.
      q: (n,) start in the free coordinates.
      v: (n,) their rates.
      embeddings: the embeddings by name, e.g. {"constrained": ...}.
      drift: how an embedding treats the drift of its constraints; see `Constrained`.
    Raises:
      ValueError: `formulation` is not one of this mechanism.
    """
    _checks.choice("formulation", formulation, [*_FREE, *embeddings])
    _checks.choice("drift", drift, DRIFTS)
    q, v = floats(q, v)
    if formulation in _FREE:
        return _FREE[formulation](free), jnp.concatenate([q, v])
    mechanism, place = embeddings[formulation]
    t = np.zeros(())
    return Constrained(mechanism, drift), _place(place, t, q, v)


@eqx.filter_jit
def _place(place: Callable, t: Array, q: Array, v: Array) -> Array:
    """(k,) the coordinates of an embedding and their rates; in one compiled program."""
    return jnp.concatenate(jax.jvp(place, (t, q), (jnp.ones_like(t), v)))
