"""The segments of a motion, each integrated independently with its variational equations."""

import dataclasses
import functools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn.integrate.flow import SolveResult
from jaxdyn.integrate.spans import host_floats
from orbits.motion import advance

#: Maximum steps of one segment: no orbit that can be found takes more, and an iteration towards a
#: collision must not take minutes.
MAX_STEPS = 200_000


class Limits(NamedTuple):
    """The limits at which integrations of segments end early.

    Attributes:
      max_steps: largest number of steps of one segment.
      over: whether the time is up; asked before each segment, which is not interrupted.
    """

    max_steps: int = MAX_STEPS
    over: Callable[[], bool] = lambda: False


#: The limits of evaluations whose time is not limited.
UNTIMED = Limits()


@dataclasses.dataclass(frozen=True)
class OwnNumber:
    """A number of the scene itself as the parameter of a family.

    The scene's other numbers then are data of the compiled program. With a function that makes
    scenes they are constants, and the program is compiled again for each of their values.

    Attributes:
      where: a function from a scene to that number; each new function compiles the program again.
    """

    where: Callable[[Scene], Any]

    def of(self, scene: Scene, value: Array) -> Scene:
        """The scene with the given value of the number."""
        return eqx.tree_at(self.where, scene, value)


#: A function from the parameter of a family to a scene, whose start and span are not used.
Make = Callable[[Array], Scene] | OwnNumber


class Piece(NamedTuple):
    """The inputs of a segment's integration; with a first axis of segments if there are several."""

    start: Array
    t0: Array
    span: Array
    parameter: Array
    s: Array | None = None  # logarithmic time; not differentiated


class LinearizedEnd(NamedTuple):
    """A segment's end and its derivatives; with a first axis of segments if there are several.

    Attributes:
      y1: (k,) the end; NaN if the motion ends early.
      status: () `Status` code.
      steps: () accepted steps.
      slopes: derivatives of the end with respect to each field of the segment's inputs.
    """

    y1: Array
    status: Array
    steps: Array
    slopes: Piece


def scene_of(scene: Scene, make: Make | None, parameter) -> Scene:
    """The scene, or that of `make` at the parameter, with the scene's start and span."""
    if make is None:
        return scene
    if isinstance(make, OwnNumber):
        return make.of(scene, parameter)
    return make(parameter).starting(scene.y0, scene.t1)


def end_of(
    scene: Scene, make: Make | None, piece: Piece, rtol, max_steps: int = MAX_STEPS
) -> SolveResult:
    """A segment's end, without the derivatives."""
    scene = scene_of(scene, make, piece.parameter).starting(piece.start)
    return advance(scene, piece.span, piece.s, t0=piece.t0, rtol=rtol, max_steps=max_steps)


def map_segments(integrate: Callable[[Piece], Any], pieces: Piece):
    """The results of a function for each segment, stacked; several run at once, on all cores."""
    count = len(pieces.span)
    inputs = [jax.tree.map(lambda leaf, i=i: leaf[i], pieces) for i in range(count)]
    if count == 1:  # starting a thread takes as long as a few integrations
        found = [integrate(inputs[0])]
    else:
        with ThreadPoolExecutor(min(count, os.cpu_count() or count)) as threads:
            found = list(threads.map(integrate, inputs))
    return jax.tree.map(lambda *leaves: np.stack(leaves), *found)


def linearize_end(
    scene: Scene, piece: Piece, rtol, *, limits: Limits = UNTIMED, make: Make | None = None
) -> LinearizedEnd:
    """A segment's end with its derivatives.

    The search for an orbit, its growth of errors and its stability all use this one program.
    """
    piece, rtol = jax.tree.map(host_floats, (piece, rtol))
    return compiled_end(scene, piece, rtol, limits.max_steps, make=make)


@functools.partial(jax.jit, static_argnames="make")
def compiled_end(
    scene: Scene, piece: Piece, rtol, max_steps, *, make: Make | None
) -> LinearizedEnd:
    """`linearize_end` for arrays alone, since Python numbers would recompile."""

    def end(at: Piece):
        found = end_of(scene, make, at._replace(s=piece.s), rtol, max_steps)
        return found.y1, (found.y1, found.status, found.steps)

    slopes, (y1, status, steps) = jax.jacfwd(end, has_aux=True)(piece._replace(s=None))
    return LinearizedEnd(y1, status, steps, slopes)
