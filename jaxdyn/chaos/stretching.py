"""Orthonormal tangents carried along a motion, and the factors by which they are stretched.

A frame Q of orthonormal tangents is integrated with the motion over a short chunk and then
orthonormalised again, V = Q' R. The diagonal of R contains the factors by which the chunk stretches
the flag of subspaces that Q spans; it is positive, and the sum of the logarithms over time tends to
the Lyapunov exponents.

Orthonormalisation is by Gram-Schmidt with each column projected twice, which is as orthogonal as
Householder's (Giraud, Langou & Rozloznik 2005), without LAPACK inside the loop.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn.integrate.flow import Variational, flow
from jaxdyn.integrate.march import Limits
from jaxdyn.plan.plan import Branch
from jaxdyn.solvers import Method
from jaxdyn.status import Status


class Stretching(eqx.Module):
    """A field for a state, its tangents, and the integral of the Jacobian's diagonal.

    The columns of its state (k, 1 + m + 1) are the motion, m tangents, and the integrals of the k
    diagonal entries of the Jacobian, whose sum is the integral of the divergence of the rate.

    Attributes:
      variational: the motion with its tangents.
    """

    variational: Variational

    @classmethod
    def of(cls, field) -> "Stretching":
        """The field with tangents, for a field whose numbers are not perturbed."""
        return cls(Variational(field, jax.tree.map(lambda _: None, field)))

    def rate(self, t: Array, y: Array) -> Array:
        """Rates (k, 1 + m + 1) of all columns."""
        k = y.shape[0]
        # The unit vectors are further tangents at this time: one linearisation for all.
        rates = self.variational.rate(t, jnp.concatenate([y[:, :-1], jnp.eye(k)], axis=1))
        diagonal = jnp.sum(rates[:, -k:] * jnp.eye(k), axis=1)
        return jnp.concatenate([rates[:, :-k], diagonal[:, None]], axis=1)

    @property
    def field(self):
        """The field of the state alone."""
        return self.variational.field

    @property
    def single(self):
        """The field of the state alone, under the name that solvers use."""
        return self.field

    def around(self, change: Callable, branch: Any) -> "Stretching":
        """The same columns of the field in a branch of its conditions; see `plan.plan`."""
        return Stretching(self.variational.around(change, branch))

    def jump(self, t: Array, y: Array, old: Branch, new: Branch, which: Array) -> Array:
        """State and tangents after a switch; how it stretches volumes counts as divergence."""
        k = y.shape[0]
        columns = jnp.concatenate([y[:, :-1], jnp.eye(k)], axis=1)
        columns = self.variational.jump(t, columns, old, new, which)
        # The saltation matrix is the identity with a matrix of rank one: det = 1 + its trace.
        stretched = jnp.log(jnp.abs(1.0 + jnp.trace(columns[:, -k:] - jnp.eye(k))))
        return jnp.concatenate([columns[:, :-k], y[:, -1:] + stretched / k], axis=1)

    def project(self, t: Array, y: Array) -> Array:
        """The state on its constraints, with its tangents along them."""
        return jnp.concatenate([self.variational.project(t, y[:, :-1]), y[:, -1:]], axis=1)

    def undetermined(self, t: Array, y: Array) -> Array | None:
        """See `Field.undetermined`."""
        return self.variational.undetermined(t, y)

    def loses(self, t0: Array, y0: Array, t1: Array, y1: Array) -> Array | None:
        """See `Field.loses`."""
        return self.variational.loses(t0, y0, t1, y1)


class Carried(NamedTuple):
    """A motion with its orthonormal tangents after a number of chunks.

    Attributes:
      y: (k,) state.
      frame: (k, m) orthonormal tangents, in the sizes of the entries.
      logs: (m,) logarithms of the factors by which they were stretched, summed.
      divergence: () integral of the divergence of the rate.
      steps: () accepted steps.
      status: () `Status` code of the last chunk.
      done: () number of chunks, as a float, since times are multiples of a chunk.
    """

    y: Array
    frame: Array
    logs: Array
    divergence: Array
    steps: Array
    status: Array
    done: Array


def start(y: Array, frame: Array, status: Array) -> Carried:
    """The motion with its tangents before the first chunk."""
    return Carried(
        y=y,
        frame=frame,
        logs=jnp.zeros(frame.shape[1]),
        divergence=jnp.zeros(()),
        steps=jnp.zeros((), int),
        status=status,
        done=jnp.zeros(()),
    )


def carry(
    field,
    begun: Carried,
    sizes: Array,
    t0: Array,
    chunk: Array,
    count: Array,
    limits: Limits,
    method: Method,
) -> Carried:
    """The motion, of entries of sizes (k,), and its tangents after `count` equal chunks from t0.

    It stops at the first chunk that does not reach its end.
    """
    stretching = Stretching.of(field)

    def again(now: Carried) -> Array:
        return (now.done < count) & (now.status == Status.OK)

    def advance(now: Carried) -> Carried:
        t = t0 + now.done * chunk
        frame = now.frame * sizes[:, None]
        y = jnp.concatenate([now.y[:, None], frame, jnp.zeros_like(now.y)[:, None]], axis=1)
        run = flow(stretching, y, t, t + chunk, jnp.zeros(0), limits, method=method)
        frame, factors = orthonormal(run.y1[:, 1:-1] / sizes[:, None])
        return Carried(
            y=run.y1[:, 0],
            frame=frame,
            logs=now.logs + jnp.log(factors),
            divergence=now.divergence + jnp.sum(run.y1[:, -1]),
            steps=now.steps + run.steps,
            status=run.status,
            done=now.done + 1.0,
        )

    return jax.lax.while_loop(again, advance, begun)


def orthonormal(v: Array) -> tuple[Array, Array]:
    """Q (k, m) and the positive diagonal (m,) of R with v = Q R, without LAPACK.

    Args:
      v: (k, m) independent columns, m <= k.
    Example:
      >>> import jax.numpy as jnp
      >>> from jaxdyn.chaos.stretching import orthonormal
      >>> Q, r = orthonormal(jnp.array([[3.0, 1.0], [4.0, 0.0]]))
      >>> [round(float(x), 12) for x in r]
      [5.0, 0.8]
    """
    m = v.shape[1]

    def column(j, found):
        q, r = found
        here = jnp.arange(m) == j
        x = jax.lax.dynamic_index_in_dim(v, j, 1, keepdims=False)
        for _ in range(2):  # a single projection is not orthogonal for almost parallel columns
            shares = jnp.sum(q * x[:, None], axis=0)
            x = x - jnp.sum(q * shares[None, :], axis=1)
        length = jnp.sqrt(jnp.sum(x * x))
        return jnp.where(here[None, :], (x / length)[:, None], q), jnp.where(here, length, r)

    return jax.lax.fori_loop(0, m, column, (jnp.zeros_like(v), jnp.zeros(m)))
