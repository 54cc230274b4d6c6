"""The record of an error estimate, and differences of states in the units of their entries."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _text
from jaxdyn.plan import plan_of
from jaxdyn.scales import at_start
from jaxdyn.scene import Field, Scene
from jaxdyn.system import Record

#: Distance of a promised digit from rounding, in spreads of two draws; 1 in 26 is wrong by more.
ROUNDING_MARGIN = 5.0
#: Entries below this part of what others move them by may be only rounding.
_NOTHING = 1e-10


class Estimate(Record):
    """How far a solution is from the exact one.

    Attributes:
      ts: (s,) times [s].
      ys: (s, k) the solution.
      error: (s, k) estimated absolute error of each entry, in its unit.
      rounding: (s, k) the part of it that no tolerance removes; NaN where not measured.
      scale: (k,) the measure of errors: the largest entry of its kind. Angles are taken modulo a
        turn.
      kind: the kind of estimate.
      solver: name of the method of the solution.
      other: name of the method of the second solution.
      wanted: () digits requested, if any.
      fineness: (2,) tolerances, or steps, of the solution and of the second one.
    """

    ts: Array
    ys: Array
    error: Array
    rounding: Array
    scale: Array
    fineness: Array
    kind: str = eqx.field(static=True)
    solver: str = eqx.field(static=True)
    other: str = eqx.field(static=True)
    wanted: Array | float | None = None

    @_text.never_raising
    def __repr__(self) -> str:
        digits = f"{self.digits:.1f} at {len(self.ts)} times, at most {self.most_digits:.1f}"
        rows = [("digits", digits), ("basis", self.basis), ("shortfall", self.shortfall)]
        return _text.table("Estimate", rows)

    _repr_html_ = _text.html

    @property
    def relative(self) -> float:
        """Largest error relative to the scale; NaN if a run failed; host only."""
        return float(np.max(np.asarray(self.error) / np.asarray(self.scale)))

    @property
    def digits(self) -> float:
        """Correct digits at all times, 0 if none; NaN if a run failed; host only."""
        return digits_of(self.relative)

    @property
    def most_digits(self) -> float:
        """Digits certain in double precision with any solver; host only."""
        return digits_of(
            ROUNDING_MARGIN * np.max(np.asarray(self.rounding) / np.asarray(self.scale))
        )

    @property
    def basis(self) -> str:
        """The basis of the estimate, as text; host only."""
        mine, its = np.asarray(self.fineness)
        return f"{self.kind}: {self.solver} at {mine:.1e} against {self.other} at {its:.1e}"

    @property
    def shortfall(self) -> str:
        """Why requested digits were not reached, and the remedy; empty if they were; host only."""
        sure = min(self.digits, self.most_digits)
        if self.wanted is None or not sure < self.wanted:
            return ""
        held = self.until(self.wanted)
        where = "at no sample" if np.isnan(held) else f"up to t = {held:.6g}"
        return (
            f"{self.wanted:g} digits were requested; over the whole span {sure:.1f} are certain, "
            f"all of them {where}. Rounding, amplified, limits any solver to "
            f"{self.most_digits:.1f} certain digits: shorten the span."
        )

    def until(self, digits: float) -> float:
        """Time up to which this many digits are certain; NaN if at no time; host only."""
        off = np.maximum(self.error, ROUNDING_MARGIN * np.nan_to_num(self.rounding))
        # With > instead, a run that failed, whose errors are NaN, would be right to its end.
        wrong = ~((off / np.asarray(self.scale)).max(axis=1) <= 10.0**-digits)
        first = int(np.argmax(wrong)) if wrong.any() else len(wrong)
        return float(self.ts[first - 1]) if first else float("nan")


def kind_of(kind: str, scene: Scene) -> str:
    """A kind of estimate, and what the estimate, like the solution, is blind to; host only."""
    unread = plan_of(scene.field, len(scene.y0)).unread
    return f"{kind}, blind to {', '.join(sorted(unread))}" if unread else kind


def digits_of(error) -> float:
    """() correct digits at a relative error, 0 if none; NaN for an error that is not finite."""
    return max(0.0, -float(np.log10(error))) if np.isfinite(error) else float("nan")


def scales(scene: Scene, ys: np.ndarray) -> np.ndarray:
    """(k,) largest magnitude over times (s, k) of the entries of a kind, see `scales.Groups`.

    Entries that are zero, or rounding, are measured by what others move them by; 1 if none does.
    """
    sizes = np.abs(gaps(scene, ys, np.zeros_like(ys))).max(axis=0)
    return np.asarray(_of_kinds(scene.field, sizes, scene.y0, scene.t1))


@eqx.filter_jit
def _of_kinds(field: Field, sizes: Array, y0: Array, t1: Array) -> Array:
    # Angles are not capped at a radian: differences are within a turn.
    kinds = field.groups._replace(most=(np.inf,) * len(y0))
    sizes, moved = kinds.sizes(sizes), at_start(field, kinds, jnp.zeros(()), y0, t1)[0].sizes
    sizes = jnp.where(sizes > _NOTHING * moved, sizes, moved)
    return jnp.where(sizes == 0, 1.0, sizes)


def gaps(scene: Scene, ys: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(s, k) differences of states in the system's sense, angles modulo a turn."""
    plain = ys - others
    wrapped = np.asarray(_differences(scene.system, ys, others))
    # Wrapping an angle rounds it by 4e-16; where nothing is wrapped the plain difference is exact.
    return np.where(np.abs(plain) <= 1.0, plain, wrapped)


@eqx.filter_jit
def _differences(system, ys, others):
    return jax.vmap(system.difference)(ys, others)
