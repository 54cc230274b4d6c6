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

from jaxdyn import _checks
from jaxdyn.scene import Field, FieldAround
from jaxdyn.system import Record


class FixedField(Record, FieldAround):
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
    def field(self) -> Field:
        """The field with numbers that are constants."""
        with jax.ensure_compile_time_eval():
            leaves = [
                jnp.asarray(np.frombuffer(data, kind).reshape(shape))
                for data, shape, kind in self.numbers
            ]
        return jax.tree.unflatten(self.rest, leaves)
