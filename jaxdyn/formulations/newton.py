"""Newton's law for free points: m_i a_i = sum of the forces on point i.

State ``[r_1 .. r_n, v_1 .. v_n]``, each in d cartesian components.
"""

import itertools

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._floats import as_float
from jaxdyn.scene import Points, System
from jaxdyn.system import total_force

_AXES = "xyz"


class FreePoints(System):
    """n points of mass m (n,) [kg] in d dimensions, moved by forces alone."""

    m: Array
    d: int = eqx.field(static=True)

    def __init__(self, m, d: int = 2):
        m = as_float(m)
        self.m = m if m.ndim else m[None]
        self.d = d

    @property
    def accepts(self):
        return frozenset({"force"})

    @property
    def second_order(self) -> bool:
        return True

    def labels(self):
        n = self.m.shape[0]
        suffix = [""] if n == 1 else [str(i + 1) for i in range(n)]
        r = [(f"{axis}{s}", "m") for s in suffix for axis in _AXES[: self.d]]
        return (*r, *((f"v{name}", "m/s") for name, _ in r))

    def points(self, t, y):
        del t
        r, v = y.reshape(2, self.m.shape[0], self.d)
        return Points(r, v, self.m)

    def rate(self, t, y, effects):
        r, v, m = self.points(t, y)
        return _state(v, total_force(effects, t, r, v, m) / m[:, None])

    def canonical(self, t, y):
        r, v, m = self.points(t, y)
        return _state(r, m[:, None] * v)

    def generators(self, y):
        r, v, _ = self.points(jnp.zeros(()), y)
        found = {}
        for i in range(self.d):
            shift = jnp.zeros_like(r).at[:, i].set(1.0)
            found[f"shift along {_AXES[i]}"] = _state(shift, jnp.zeros_like(v))
        for i, j in itertools.combinations(range(self.d), 2):
            turn = jnp.zeros((self.d, self.d)).at[j, i].set(1.0).at[i, j].set(-1.0)
            found[f"turn in {_AXES[i]}{_AXES[j]}"] = _state(r @ turn.T, v @ turn.T)
        return found

    def check(self, t, y):
        del t, y
        _checks.array("mass", self.m, (None,), "One mass for each point.")
        _checks.positive("mass", self.m, "Masses are in kg.")


def _state(r: Array, v: Array) -> Array:
    return jnp.concatenate([r.ravel(), v.ravel()])
