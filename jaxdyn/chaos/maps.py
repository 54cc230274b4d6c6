"""Maps of regular and chaotic motion over two numbers of a scene."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, ClassVar

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _labelled, _text
from jaxdyn._labelled import Labelled, Values
from jaxdyn.chaos.indicators import RTOL, megno
from jaxdyn.chaos.timed import Timed
from jaxdyn.files.layout import Layout
from jaxdyn.files.rows import program_text, rows_in
from jaxdyn.scene import Scene
from jaxdyn.status import Status

#: The layout of a map's file, and the number of motions in one of its lines.
_LAYOUT = Layout("jaxdyn-chaos-map", 1, "jaxdyn.chaos.chaos_map")
_CHUNK = 1024


class ChaosMap(Timed):
    """The mean MEGNO over a grid of two numbers: first by row, second by column.

    Attributes:
      first: (a,) values of the first number.
      second: (b,) values of the second number.
      mean: (a, b) mean MEGNO [1]: about 2 where motions are regular, larger where they are chaotic;
        NaN where there is no motion, or it failed.
      exponent: (a, b) mean growth rate of a tangent [1/s], in 1 over the scenes' unit of time.
      time: (a, b) time of each motion [s], in the scenes' unit of time.
      status: (a, b) `Status` codes.
    """

    first: np.ndarray
    second: np.ndarray
    mean: np.ndarray
    exponent: np.ndarray
    time: np.ndarray
    status: Annotated[np.ndarray, Status]

    #: Mean MEGNO above which a motion counts as chaotic: that of regular motions stays near 2.
    CHAOTIC: ClassVar[float] = 3.0

    __repr__ = _text.fields
    _repr_html_ = _text.html
    to_pandas = _labelled.to_pandas
    to_xarray = _labelled.to_xarray

    def _to_labelled(self) -> Labelled:
        axes = "first", "second"
        per, s = (self.in_units(unit) for unit in ("1/s", "s"))
        units = {"mean": "1", "exponent": per, "time": s, "status": ""}
        return Labelled(
            {axis: Values((axis,), getattr(self, axis)) for axis in axes},
            {name: Values(axes, getattr(self, name), unit) for name, unit in units.items()},
        )

    @property
    def ok(self) -> np.ndarray:
        """(a, b) whether each motion reached its end."""
        return self.status == Status.OK

    @property
    def chaotic(self) -> np.ndarray:
        """(a, b) whether each motion is chaotic; a longer time may reveal more chaotic ones."""
        return self.mean > self.CHAOTIC

    def as_dict(self) -> dict[str, Any]:
        """All numbers as lists, with None for NaN."""
        return {
            name: _text.with_null(getattr(self, name))
            for name in ("first", "second", "mean", "exponent", "time", "status")
        }


def chaos_map(
    make: Callable[[Array, Array], Scene],
    first,
    second,
    t1=None,
    *,
    rtol: float = RTOL,
    path: str | Path | None = None,
    progress: bool = False,
) -> ChaosMap:
    """The MEGNO of a scene over a grid of two of its numbers, on all cores.

    Args:
      make: (x, y) -> the scene at these values: parameters, or entries of its start; a named
        function. A start that does not exist, e.g. because its energy is too low, is NaN there.
      first: (a,) values of x.
      second: (b,) values of y.
      t1: () end time [s]; the scenes' own spans by default.
      rtol: relative tolerance of a step.
      path: file (.jsonl) to which motions are written as they are computed; the same call resumes
        from it where it was interrupted, with the same result.
      progress: show a bar.
    Raises:
      ValueError: no numbers, no finite start at all, the file belongs to another call, or see
        `ensemble.run`.
    Example:
      >>> from jaxdyn import chaos, scenes
      >>> def released(angle, length):
      ...     return scenes.pendulum(angle=angle, length=length)
      >>> found = chaos.chaos_map(released, [1.0, 2.0], [1.0], 1000.0)
      >>> bool(abs(found.mean - 2.0).max() < 0.1)
      True
    """
    first, second, xs, ys = _checks.grid(first, second)
    every = _scenes(make, xs, ys)
    finite = np.isfinite(np.asarray(every.y0)).all(axis=1)
    if not finite.any():
        raise _checks.fail("make", "at least one scene with a finite start", "none")
    one = jax.tree.map(lambda x: x[int(np.argmax(finite))], every)

    def rows(some: Scene) -> np.ndarray:
        found = megno(one, some.y0, t1, params=some, rtol=rtol, progress=progress)
        columns = (found.mean, found.exponent, found.time, found.status)
        return np.stack([np.asarray(x, float) for x in columns], axis=1)

    program = program_text(lambda scene, t, y: scene.rate(t, y), one, 0.0, one.y0)
    with rows_in(path, _LAYOUT, (program, every, t1, rtol), _CHUNK) as kept:
        *values, status = kept.compute(every, rows).T.reshape(4, len(first), len(second))
    time_unit = _text.second(one.labels())
    return ChaosMap(first, second, *values, status=status.astype(int), time_unit=time_unit)


@eqx.filter_jit
def _scenes(make: Callable[[Array, Array], Scene], xs: Array, ys: Array) -> Scene:
    return jax.vmap(make)(xs, ys)
