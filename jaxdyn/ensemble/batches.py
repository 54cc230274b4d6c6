"""Batches of motions, shared among threads and devices.

A compiled program releases the GIL, so one thread per core keeps all cores busy; several devices
share each call of the program, each with a queue of its own.
"""

import functools
import os
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental import multihost_utils
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from jaxdyn.ensemble.lanes import Ends, Motions, integrate
from jaxdyn.integrate.march import Limits, Watch
from jaxdyn.solvers import Method

_AXIS = "motions"
#: Rows of the program's queue on a core of a CPU: some 60 rounds of its lanes, so that the last
#: round, in which lanes run out of work, costs little.
_ROWS = 2048
#: Entries of all states that another device is passed at once: enough to keep a large GPU busy (for
#: three bodies it reaches its highest rate from 100 000 motions on), some 300 MB with their stages.
_ENTRIES = 2**21


def mesh_of(devices) -> Mesh:
    """The mesh of the devices in one row."""
    return Mesh(np.array(devices), (_AXIS,))


class Job(NamedTuple):
    """The common data of all motions, and how they are run.

    Attributes:
      shared: the field, with None in place of the numbers that each motion has for itself.
      limits: tolerances, and the maximum number of steps.
      watch: the observer.
      method: the method.
      chunk: rows of the program's queue.
      together: whether all of them start together, see `integrate`.
      threads: number of batches in flight.
      mesh: the devices that share each chunk; None for the default device alone.
    """

    shared: Any
    limits: Limits
    watch: Watch | None
    method: Method
    chunk: int
    together: bool
    threads: int
    mesh: Mesh | None

    @property
    def rows(self) -> int:
        """Number of motions of one call of the program."""
        return self.chunk * (1 if self.mesh is None else self.mesh.size)

    def results(self, batches: Iterable[Motions]) -> Iterator[Ends]:
        """The ends of batches, in their order."""
        pool = ThreadPoolExecutor(self.threads)
        waiting: deque = deque()
        try:
            for batch in batches:
                waiting.append(pool.submit(self.ends, batch))
                if len(waiting) > 2 * self.threads:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            # This is also reached where the caller abandons the iterator.
            pool.shutdown(cancel_futures=True)

    def ends(self, batch: Motions) -> Ends:
        """The ends of one batch, by successive calls of the program."""
        n = len(batch.y0)
        calls = [slice(i, i + self.rows) for i in range(0, n, self.rows)]
        parts = [self._call(jax.tree.map(lambda x, s=s: x[s], batch)) for s in calls]
        return jax.tree.map(lambda *parts: np.concatenate(parts), *parts)

    def _call(self, batch: Motions) -> Ends:
        common = (self.limits, self.watch)
        if self.mesh is None:
            n = len(batch.y0)
            queue = jax.tree.map(self._pad, batch)
            out = _on_one_device(
                self.shared, queue, n, *common, method=self.method, together=self.together
            )
            return jax.tree.map(lambda x: np.asarray(x)[:n], out)
        return self._share_out(batch, common, self.mesh)

    def _share_out(self, batch: Motions, common: tuple, mesh: Mesh) -> Ends:
        """One call on all devices, each with an equal part of the batch in a queue of its own."""
        sharding = NamedSharding(mesh, PartitionSpec(_AXIS))

        def spread(x: np.ndarray) -> jax.Array:
            rows = np.concatenate([self._pad(part) for part in np.array_split(x, mesh.size)])
            return jax.make_array_from_callback(rows.shape, sharding, rows.__getitem__)

        counts = np.array([len(part) for part in np.array_split(batch.y0, mesh.size)])
        given = jax.make_array_from_callback(counts.shape, sharding, counts.__getitem__)
        queues = jax.tree.map(spread, batch)
        out = _on_devices(mesh, self.method, self.together)(self.shared, queues, given, *common)
        out = multihost_utils.process_allgather(out, tiled=True)
        wanted = (np.arange(self.chunk)[None] < counts[:, None]).ravel()
        return jax.tree.map(lambda x: np.asarray(x)[wanted], out)

    def _pad(self, x: np.ndarray) -> np.ndarray:
        return np.concatenate([x, np.zeros((self.chunk - len(x), *x.shape[1:]), x.dtype)])


_on_one_device = jax.jit(integrate, static_argnames=("method", "together"))


@functools.cache
def _on_devices(mesh: Mesh, method: Method, together: bool):
    """The program for a mesh: each device goes through its own queue and waits for no other."""

    def one(shared, motions, count, limits, watch):
        return integrate(shared, motions, count[0], limits, watch, method=method, together=together)

    every, own = PartitionSpec(), PartitionSpec(_AXIS)
    # The check rejects loops that start from constants and continue with per-device values.
    return jax.jit(
        jax.shard_map(
            one, mesh=mesh, in_specs=(every, own, own, every, every), out_specs=own, check_vma=False
        )
    )


def device_kind(devices) -> str:
    """The kind of some devices, or of the default one, as JAX calls it: "cpu", "gpu", ..."""
    some = jnp.zeros(()).devices() if devices is None else devices
    return next(iter(some)).platform


def cores() -> int:
    """Number of programs that run concurrently on the default device."""
    if device_kind(None) != "cpu":
        return 1
    # Not every system reports which cores the process may use.
    return len(getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))(0))


def rows(kind: str, k: int) -> int:
    """Number of motions with states of k entries that a device is passed at once."""
    return _ROWS if kind == "cpu" else max(_ROWS, _ENTRIES // k)
