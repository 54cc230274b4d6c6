"""Pytrees on the way to the processes of an executor, as NumPy arrays, and back to JAX there."""

from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np

import jaxdyn

T = TypeVar("T")


def pack(tree: T) -> T:
    """The same pytree with its numbers as NumPy arrays, which any process can read."""
    return jax.tree.map(np.asarray, tree)


def unpack(tree: T) -> T:
    """What was packed, with its numbers as JAX arrays, in a process that is configured."""
    if not jax.config.jax_enable_x64:  # a fresh process
        jaxdyn.configure()
    return jax.tree.map(jnp.asarray, tree)
