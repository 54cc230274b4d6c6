"""Symplectic compositions: fixed steps of drifts and kicks, for long conservative runs.

Where the acceleration does not depend on velocity, y = [q, v] moves exactly under each half of
q' = v, v' = a(t, q) alone: a drift q += h v, a kick v += h a. A `Composition` alternates them,

    drift d_0, kick k_1, drift d_1, ... kick k_s, drift d_s   (sums of d and of k: 1),

and is itself the exact motion of a nearby conservative scene: energies do not drift but oscillate
with an amplitude of order h^p, however long the run. It is symmetric, so a step back undoes it.
Each drift and kick is a shear whatever its coefficients, so rounded ones still give a symplectic
map, and its variational equations, stepped by the same method, give that map's exact tangents.

When to use it: an adaptive pair of order 12 is cheaper for equal error of the state; a composition
conserves energy, and with it the shape of an orbit, over 1e5 periods and more.
"""

import dataclasses
import math
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._numerics import materialize, runtime_one
from jaxdyn.solvers.method import Advance, Method, Rate, in_loops


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Composition(Method):
    """A symmetric composition of drifts and kicks; it takes a step, not a tolerance.

    Attributes:
      name: its name in reports.
      order: its order.
      drifts: (s + 1,) lengths of the drifts, in steps.
      kicks: (s,) lengths of the kicks, in steps.
      loops: number of loops over the stages: one, or 0 where they are unrolled.
    """

    name: str
    order: int
    drifts: np.ndarray
    kicks: np.ndarray
    loops: int = 0
    adaptive: ClassVar[bool] = False
    position_only: ClassVar[bool] = True
    stable: ClassVar[float] = np.inf

    @property
    def error_order(self) -> int:
        """No error is estimated; required by diffrax."""
        return self.order

    @property
    def stages(self) -> int:
        """Kicks per step."""
        return len(self.kicks)

    @property
    def evaluations(self) -> int:
        """Accelerations per step."""
        return self.stages

    def in_loops(self, n: int) -> "Composition":
        """The same method with its stages in one loop, whatever n."""
        del n
        return in_loops(self, 1)

    def advance(self, field: Rate, t: Array, h: Array, y: Array) -> Advance:
        half = y.shape[0] // 2
        q, v = y[:half], y[half:]
        one = runtime_one(h)

        def stage(time, kick, drift, dq, dv):
            # Increments are summed separately from the state, to keep their low-order digits.
            x = q + dq if self.loops else materialize(q + dq, one)
            a = field(t + time * h, jnp.concatenate([x, v]))[half:]
            dv = dv + (kick * h) * a
            return dq + (drift * h) * (v + dv), dv

        times = np.cumsum(self.drifts)[:-1]
        dq, dv = (self.drifts[0].item() * h) * v, jnp.zeros_like(v)
        if self.loops:
            tables = [jnp.asarray(x) for x in (times, self.kicks, self.drifts[1:])]

            def body(i, sums):
                return stage(*(x[i] for x in tables), *sums)

            dq, dv = jax.lax.fori_loop(0, self.stages, body, (dq, dv))
        else:
            rows = zip(times.tolist(), self.kicks.tolist(), self.drifts[1:].tolist(), strict=True)
            for row in rows:
                dq, dv = stage(*row, dq, dv)
        increment = jnp.concatenate([dq, dv])
        return Advance(increment, jnp.zeros_like(y))


def _palindrome(half: tuple[float, ...], n: int) -> list[float]:
    """A palindrome of n numbers with sum 1, from its first numbers.

    For odd n the number in the middle follows from the sum, for even n the two there.
    """
    inner = 1.0 - 2.0 * math.fsum(half)
    middle = [inner] if n % 2 else [inner / 2, inner / 2]
    return [*half, *middle, *reversed(half)]


def _of_verlet(name: str, order: int, steps: tuple[float, ...]) -> Composition:
    """A palindrome of Verlet steps of these lengths; the middle one follows."""
    kicks = _palindrome(steps, 2 * len(steps) + 1)
    drifts = [(a + b) / 2 for a, b in zip([0.0, *kicks], [*kicks, 0.0], strict=True)]
    return Composition(name=name, order=order, drifts=np.array(drifts), kicks=np.array(kicks))


#: Stormer and Verlet, 1 acceleration per step: cheap where a few digits suffice.
VERLET = _of_verlet("Verlet 2", 2, ())
#: Blanes, Moan (2002), J. Comput. Appl. Math. 142, 313, the Nystrom method SRKN 14a.
BLANES_MOAN6 = Composition(
    name="Blanes-Moan 6",
    order=6,
    drifts=np.array(
        _palindrome(
            (
                *(0.0378593198406116, 0.102635633102435, -0.0258678882665587, 0.314241403071447),
                *(-0.130144459517415, 0.106417700369543, -0.00879424312851058),
            ),
            15,
        )
    ),
    kicks=np.array(
        _palindrome(
            (
                *(0.09171915262446165, 0.183983170005006, -0.05653436583288827),
                *(0.004914688774712854, 0.143761127168358, 0.328567693746804),
            ),
            14,
        )
    ),
)
#: Kahan, Li (1997), Math. Comp. 66, 1089, s17odr8a: 17 Verlet steps.
KAHAN_LI8 = _of_verlet(
    "Kahan-Li 8",
    8,
    (
        *(0.13020248308889008087881763, 0.56116298177510838456196441),
        *(-0.38947496264484728640807860, 0.15884190655515560089621075),
        *(-0.39590389413323757733623154, 0.18453964097831570709183254),
        *(0.25837438768632204729397911, 0.29501172360931029887096624),
    ),
)
#: Sofroniou, Spaletta (2005), Optim. Methods Softw. 20, 597: 35 Verlet steps.
SOFRONIOU_SPALETTA10 = _of_verlet(
    "Sofroniou-Spaletta 10",
    10,
    (
        *(0.07879572252168641926390768, 0.31309610341510852776481247),
        *(0.02791838323507806610952027, -0.22959284159390709415121340),
        *(0.13096206107716486317465686, -0.26973340565451071434460973),
        *(0.07497334315589143566613711, 0.11199342399981020488957508),
        *(0.36613344954622675119314812, -0.39910563013603589787862981),
        *(0.10308739852747107731580277, 0.41143087395589023782070412),
        *(-0.00486636058313526176219566, -0.39203335370863990644808194),
        *(0.05194250296244964703718290, 0.05066509075992449633587434),
        0.04967437063972987905456880,
    ),
)
