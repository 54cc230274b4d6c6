"""How the energy changes along a motion in pieces, and what changes it.

Where dE/dt vanishes by the equations themselves, a change is the integrator's error; where not,
the effects without a potential do work, or the motion is driven, or its contacts rub. Between two
pieces it is an impact.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.energy import along, energy, potential
from jaxdyn.phases import Chain, pieces_of
from jaxdyn.scene import Scene
from jaxdyn.simulate import Trajectory

_KEPT = 1e-9  # of the energy's size: the equations keep what they change by less in the span


class EnergyChange(NamedTuple):
    """How much the energy of a motion changes.

    Attributes:
      size: the largest change [1], see `energy.drift`.
      causes: what changes it: classes of effects, phases, "impacts", "the drive"; none where it is
        kept but for the integrator's error.
    """

    size: float
    causes: tuple[str, ...]


# Motions near the largest floats: their energies are infinite, or not known.
@np.errstate(over="ignore", invalid="ignore")
def energy_change(motion: Trajectory | Chain) -> EnergyChange | None:
    """The change of the energy over all pieces; None without energy, or where it is not known.

    Example:
      >>> from jaxdyn import scenes, simulate
      >>> energy_change(simulate(scenes.cannonball(drag=0.1))).causes
      ('QuadraticDrag',)
    """
    pieces = pieces_of(motion)
    if not pieces[0].r.shape[1] or len(pieces[0].ts) < 2:
        return None
    totals, potentials = (
        [np.asarray(along(quantity, piece)) for piece in pieces] for quantity in (energy, potential)
    )
    total, v = np.concatenate(totals), np.concatenate(potentials)
    size = np.max(np.abs(total - v) + np.abs(v)) or 1.0
    change = np.max(np.abs(total - total[0])) / size
    if not np.isfinite(change):
        return None
    names = motion.names if isinstance(motion, Chain) else ("the drive",)
    found = [cause for i, piece in enumerate(pieces) for cause in _causes(piece, names[i], size)]
    jumps = [abs(two[0] - one[-1]) for one, two in itertools.pairwise(totals)]
    if any(jump > _KEPT * size for jump in jumps):
        found.append("impacts")
    return EnergyChange(float(change), tuple(dict.fromkeys(found)))


def _causes(piece: Trajectory, otherwise: str, size: float) -> Sequence[str]:
    """What changes the energy in a piece, by its equations."""
    gains = np.asarray(_gains(piece.scene, piece.ts, piece.ys))
    if not np.max(np.abs(gains)) * np.ptp(np.asarray(piece.ts)) > _KEPT * size:
        return ()
    r, _, m = piece.scene.system.points(piece.ts[0], piece.ys[0])
    effects = piece.scene.effects
    working = [type(e).__name__ for e in effects if e.potential(piece.ts[0], r, m) is None]
    return working or (otherwise,)


@eqx.filter_jit
def _gains(scene: Scene, ts: Array, ys: Array) -> Array:
    """(s,) dE/dt [W] by the equations."""

    def gain(t, y):
        def total(t, y):
            return energy(scene, t, y)

        return jax.jvp(total, (t, y), (jnp.ones_like(t), scene.rate(t, y)))[1]

    return jax.vmap(gain)(ts, ys)
