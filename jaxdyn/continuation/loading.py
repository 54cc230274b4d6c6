"""Families of equilibria and curves from a file."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np

from jaxdyn._checks import fail
from jaxdyn._records import with_captures
from jaxdyn.continuation import checkpoint
from jaxdyn.continuation.branch import Branch, read
from jaxdyn.continuation.curve import Curve, CurvePoint, MakeOfTwo
from jaxdyn.continuation.defining import Make
from jaxdyn.continuation.family import Equilibrium, EquilibriumFamily
from jaxdyn.continuation.units import units_of

_HOLDS = 1e-8  # largest rate, in units of the family, of an equilibrium of these scenes


def load(path: str | Path, make: Make | MakeOfTwo) -> tuple[EquilibriumFamily | Curve, ...]:
    """The families of equilibria, or the curves, in a file; even while it is being written.

    Args:
      path: path of the file that `continue_equilibria` or `continue_curve` wrote with ``path=``.
      make: the scenes, as given to these functions, since files contain numbers only.
    Returns:
      The contents of the file, in order; for an interrupted run, what was found so far.
    Raises:
      ValueError: the file is of another kind, was edited or damaged, or its points are not
        equilibria of these scenes.
    Example:
      >>> import jaxdyn, tempfile
      >>> def make(rho):
      ...     return jaxdyn.scenes.lorenz(rho=rho)
      >>> path = tempfile.mkdtemp() + "/lorenz.jsonl"
      >>> first = jaxdyn.continue_equilibria(make, 20.0, [7.0, 7.0, 19.0], members=3, path=path)
      >>> (again,) = jaxdyn.continuation.load(path, make)
      >>> bool((again.parameters == first.parameters).all())
      True
    """
    make = with_captures(make)
    walks, _ = checkpoint.walks_in(path, (checkpoint.EQUILIBRIA, checkpoint.CURVE))
    readers = {checkpoint.EQUILIBRIA: equilibria, checkpoint.CURVE: _curve}
    return tuple(readers[walk.begin.what](walk, make) for walk in walks)


def equilibria(walk: checkpoint.SavedBranch, make: Make) -> EquilibriumFamily:
    """The family of equilibria of a walk."""
    found = _read(walk, Equilibrium, make)
    return EquilibriumFamily(found.members, found.special, found.end, make)


def _curve(walk: checkpoint.SavedBranch, make: MakeOfTwo) -> Curve:
    found = _read(walk, CurvePoint, make)
    return Curve(kind=found.members[0].curve, make=make, **found._asdict())


def _read(walk: checkpoint.SavedBranch, kind: type, make: Make | MakeOfTwo) -> Branch:
    """The branch of a walk, whose first and last points are checked."""
    found = read(walk, checkpoint.of_fields(kind))
    for point in (found.members[0], found.members[-1]):
        _check(make, point)
    return found


def _check(make: Make | MakeOfTwo, point: Equilibrium | CurvePoint) -> None:
    """Raise ValueError if a point is not an equilibrium of these scenes."""
    try:
        units = units_of(make, point)
        with np.errstate(all="ignore"):  # numbers of a file may be too large for their units
            scene, here = units.scene(make), units.inward(point).x
        entries = len(point.state)
        size = float(np.abs(scene(*here[entries:]).rate(jnp.zeros(()), here[:entries])).max())
    except (TypeError, ValueError, IndexError) as error:
        got = f"{type(error).__name__}: {error}"[:120]
        raise fail("make", "the scenes of the file", got, checkpoint.OTHER) from error
    if not size <= _HOLDS:
        got = f"others, with rates of {size:.1e} of what their sizes make at its equilibria"
        raise fail("make", "the scenes of the file", got, checkpoint.OTHER)
