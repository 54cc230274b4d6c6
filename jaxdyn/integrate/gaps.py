"""How far states are apart, each entry in its unit, and the sizes that this is compared with."""

import equinox as eqx
import jax
import numpy as np

from jaxdyn.scene import Scene


def scales(scene: Scene, ys: np.ndarray) -> np.ndarray:
    """(k,) largest magnitude over times of the entries with the same unit; 1 if all are 0."""
    sizes = np.abs(gaps(scene, ys, np.zeros_like(ys))).max(axis=0)
    units = [unit for _, unit in scene.system.labels()]
    of_unit = [max(s for s, u in zip(sizes, units, strict=True) if u == unit) for unit in units]
    return np.where(np.array(of_unit) == 0, 1.0, of_unit)


def gaps(scene: Scene, ys: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(s, k) differences of states in the system's sense, angles modulo a turn."""
    plain = ys - others
    wrapped = np.asarray(_differences(scene.system, ys, others))
    # Wrapping an angle rounds it by 4e-16; where nothing is wrapped the plain one is exact.
    return np.where(np.abs(plain) <= 1.0, plain, wrapped)


@eqx.filter_jit
def _differences(system, ys, others):
    return jax.vmap(system.difference)(ys, others)
