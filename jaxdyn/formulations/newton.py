"""Newton's law for free points: m_i a_i = sum of the forces on point i.

State ``[r_1 .. r_n, v_1 .. v_n]``, each in d cartesian components.

A point may have mass 0: a test particle, which moves as the limit of small masses does. Effects
that give accelerations, such as gravity, move it; a force on it is refused, since no finite
acceleration would follow from it.
"""

import itertools
from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float
from jaxdyn.joints import particles
from jaxdyn.scene import Points, System
from jaxdyn.system import check_force, total_force

_AXES = "xyz"
#: 1 / sqrt(m) of a test particle [kg^-1/2], as a part of the largest float: the acceleration by any
#: force overflows, and that by a force of 0 is 0.
_NO_MASS = 1e-8


class FreePoints(System):
    """n points of mass m (n,) [kg] in d dimensions, moved by forces alone.

    Attributes:
      m: (n,) masses [kg].
      d: number of dimensions.
      names: names of the points, as in the label x_Earth; without any they are numbered, as in x1.
      rest: the position (d,) [m] of each point in drawings where its coordinates are 0, if these
        are displacements; None if they are positions.
    """

    m: Array
    d: int = eqx.field(static=True)
    names: tuple[str, ...] = eqx.field(static=True, default=())
    rest: tuple[tuple[float, ...], ...] | None = eqx.field(static=True, default=None, repr=False)

    def __init__(self, m, d: int = 2, names: Sequence[str] = (), rest=None):
        # NumPy cannot determine the dimension of a tuple with traced numbers.
        self.m = as_float(m if isinstance(m, list | tuple) or np.ndim(m) else [m])
        self.d = d
        self.names = tuple(names)
        self.rest = None if rest is None else tuple(tuple(map(float, one)) for one in rest)

    @property
    def accepts(self):
        return frozenset({"force"})

    @property
    def second_order(self) -> bool:
        return True

    def labels(self):
        n = self.m.shape[0]
        numbered = [""] if n == 1 else [str(i + 1) for i in range(n)]
        named = [f"_{name}" for name in self.names]
        suffix = named if len(named) == n else numbered  # `check` refuses other numbers of names
        r = [(f"{axis}{s}", "m") for s in suffix for axis in _AXES[: self.d]]
        return (*r, *((f"v{name}", "m/s") for name, _ in r))

    def points(self, t, y):
        del t
        r, v = y.reshape(2, self.m.shape[0], self.d)
        return Points(r, v, self.m)

    def places(self, t, y):
        r = self.points(t, y).r
        return r if self.rest is None else r + jnp.asarray(self.rest)

    def bodies(self, t, y):
        del t, y
        return particles(self.m, self.names)

    def rate(self, t, y, effects):
        r, v, m = self.points(t, y)
        fields = [
            check_force(e, e.acceleration(t, r, v, m), r.shape) for e in effects if e.accelerates
        ]
        others = [e for e in effects if not e.accelerates]
        if others:
            massless = m == 0
            # A force that begins to act on a test particle overflows, which ends the motion.
            most = _NO_MASS * jnp.finfo(m.dtype).max
            per_mass = jnp.where(massless, most, 1 / jnp.where(massless, 1.0, m))
            again = jnp.where(massless, most, 1.0)
            forces = total_force(others, t, r, v, m)
            fields.append(forces * per_mass[:, None] * again[:, None])
        return _state(v, sum(fields[1:], fields[0]) if fields else jnp.zeros_like(v))

    def canonical(self, t, y):
        if not _checks.is_traced(self.m) and (np.asarray(self.m) == 0).any():
            return None  # the momenta of test particles do not determine velocities
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
        n = self.m.shape[0]
        whole = all(isinstance(name, str) and name for name in self.names)
        if self.names and not (whole and len(set(self.names)) == len(self.names) == n):
            got = ", ".join(map(repr, self.names))
            raise _checks.fail("names", f"{n} different ones, one for each point", got)
        _checks.array("mass", self.m, (None,), "One mass for each point.")
        if self.rest is not None:
            _checks.host_array("rest", self.rest, (n, self.d), "One position for each point.")
        m = _checks.at_least_zero("mass", self.m, "Masses are in kg; 0 is a test particle.")
        if not _checks.is_traced(m) and not np.asarray(m).any():
            remedy = "Test particles move among bodies; one has to have a mass."
            raise _checks.fail("mass", "one that is not 0", "no mass at all", remedy)

    def check_effects(self, t, y, effects):
        m = np.asarray(self.m)
        if m.all():
            return
        rng = np.random.default_rng(0)  # a force may be zero at the start, as that of a spring is
        elsewhere = rng.uniform(0.5, 1.5, y.shape) * (np.abs(y) + np.max(np.abs(y)) + 1.0)
        r, v, _ = self.points(t, elsewhere)
        for effect in effects:
            if effect.accelerates:
                continue
            acting = np.asarray(effect.force(jnp.asarray(t), r, v, jnp.asarray(m)) != 0).any(axis=1)
            if (acting & (m == 0)).any():
                raise _checks.fail(
                    type(effect).__name__,
                    "no force on a point of mass 0",
                    f"one on point {np.flatnonzero(acting & (m == 0))[0] + 1}",
                    "Give it a mass: a test particle feels accelerations, such as gravity, only.",
                )


def _state(r: Array, v: Array) -> Array:
    return jnp.concatenate([r.ravel(), v.ravel()])
