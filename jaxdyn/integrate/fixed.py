"""A vector field whose numbers are constants of the program.

XLA then folds constants, and Taylor series drop terms that are zero: a solve takes as little as
two thirds of the time. New numbers recompile, and there are no derivatives with respect to them.
The start, the times and the tolerance remain arguments.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.scales import Groups
from jaxdyn.scene import Field
from jaxdyn.system import Record, System


class FixedField(Record):
    """A field without array leaves; equal ones share a compiled program.

    Attributes:
      numbers: bytes, shape and kind of each number.
      rest: the field without them.
    """

    numbers: tuple[tuple[bytes, tuple[int, ...], str], ...] = eqx.field(static=True)
    rest: Any = eqx.field(static=True)

    def __init__(self, field: Field):
        if _checks.is_traced(field):
            remedy = "Leave it out where jit or grad traces the scene's numbers."
            raise _checks.fail("fixed", "a scene with concrete numbers", "traced ones", remedy)
        leaves, self.rest = jax.tree.flatten(field)
        arrays = map(np.asarray, leaves)
        self.numbers = tuple((x.tobytes(), x.shape, x.dtype.str) for x in arrays)

    @property
    def _field(self) -> Field:
        with jax.ensure_compile_time_eval():
            leaves = [
                jnp.asarray(np.frombuffer(data, kind).reshape(shape))
                for data, shape, kind in self.numbers
            ]
        return jax.tree.unflatten(self.rest, leaves)

    @property
    def system(self) -> System:
        """The system, with numbers that are constants."""
        return self._field.system

    def rate(self, t: Array, y: Array) -> Array:
        """The vector field dy/dt."""
        return self._field.rate(t, y)

    @property
    def groups(self) -> Groups:
        """Which entries of the state share a size."""
        return self._field.groups

    def project(self, t: Array, y: Array) -> Array:
        """The nearest state that satisfies the system's constraints."""
        return self._field.project(t, y)

    def undetermined(self, t: Array, y: Array) -> Array | None:
        """Whether () the constraints leave the acceleration undetermined at a state."""
        return self._field.undetermined(t, y)

    def loses(self, t0: Array, y0: Array, t1: Array, y1: Array) -> Array | None:
        """Whether () a step may pass a state that leaves the acceleration undetermined."""
        return self._field.loses(t0, y0, t1, y1)
