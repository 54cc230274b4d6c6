"""How many motions per second does a GPU compute, and at which part of its double-precision rate?

Run: ``python -m benchmarks ensembles --device gpu --peak 34``, the peak in TFLOP/s of
double-precision vector arithmetic, from the maker's data sheet (34 for NVIDIA's H100 SXM and
H200 SXM; 9.7 for the A100; H200 data sheet, 2024). Motions near the figure-eight, one period, error
1e-12 a step, all lanes side by side in one program; lanes wait for the slowest.
`jaxdyn.ensemble.run` takes and returns NumPy arrays, whose transfer counts. XLA counts the
floating-point operations of a step; rejected steps count as work.
"""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks._timing import Row, Times, interleave
from benchmarks.ensembles import starts
from jaxdyn import ensemble
from jaxdyn._checks import fail
from jaxdyn.integrate.simulation import solve
from jaxdyn.scene import Scene
from jaxdyn.scenes import three_body
from jaxdyn.solvers import default_solver

LANES = (100_000, 1_000_000, 10_000_000)
PEAK = 34.0  # [TFLOP/s] of the H200 SXM
_RTOL = 1e-12
_AT_ONCE = 1_000_000  # lanes in memory with all their stages
_CHECKED = 64  # motions compared with the CPU
_ROUNDS, _QUICK_ROUNDS = 5, 1


def run(kind: str, peak: float, quick: bool = False, lanes=LANES) -> list[Row]:
    """One row for each number of lanes.

    Args:
      kind: kind of device, as JAX calls it: "gpu", "cpu", ...
      peak: double-precision rate of the device [TFLOP/s].
      quick: the first number of lanes only.
      lanes: numbers of motions.
    Raises:
      ValueError: there is no device of this kind, or `peak` is not positive.
    """
    device = first_device(kind)
    if not peak > 0:
        raise fail("--peak", "above 0", peak, "It is in TFLOP/s; see the maker's data sheet.")
    counts = lanes[:1] if quick else lanes
    return [_row(device, n, peak, _QUICK_ROUNDS if quick else _ROUNDS) for n in counts]


def first_device(kind: str) -> Any:
    """The first device of a kind."""
    try:
        return jax.devices(kind)[0]
    except RuntimeError:
        there = ", ".join(sorted({d.platform for d in jax.devices()}))
        remedy = "Install JAX for it (pip install 'jax[cuda12]'), on a machine that has one."
        expected = f"a kind of device that JAX sees ({there})"
        raise fail("--device", expected, kind, remedy) from None


def _row(device: Any, n: int, peak: float, rounds: int) -> Row:
    scene, host = three_body(), starts(n)
    there, y0s = jax.device_put((scene, host), device)
    program = functools.partial(jax.jit(ends), there, y0s)
    y1, steps = program()
    with jax.default_device(jax.devices("cpu")[0]):
        here = ensemble.run(scene, host[:_CHECKED], rtol=_RTOL).y1
    apart = float(np.max(np.abs(np.asarray(y1[:_CHECKED]) - here)))
    times = interleave({0: lambda: jax.block_until_ready(program())}, rounds)[0]
    with jax.default_device(device):
        arrays = interleave({0: lambda: ensemble.run(scene, host, rtol=_RTOL)}, rounds)[0]
    work = float(jnp.sum(steps)) * operations_of_a_step(scene)
    part = work / times.minimum / (peak * 1e12)
    note = f"{n / times.minimum:.3g} motions/s, {100 * part:.2g} % of {peak:g} TFLOP/s, "
    note += f"{apart:.1e} from the CPU's"
    name = f"{n} motions on {device.device_kind}: each"
    both = {"jaxdyn": times, "jaxdyn.ensemble.run": arrays}
    each = {name: Times(*(t / n for t in of)) for name, of in both.items()}
    return Row(name, each, note=note)


def ends(scene: Scene, y0s: jax.Array) -> tuple[jax.Array, jax.Array]:
    """(n, k) the ends, and (n,) numbers of attempted steps."""

    def one(y0):
        found = solve(scene.starting(y0), scene.t1, rtol=_RTOL)
        return found.y1, found.steps + found.rejected

    return jax.lax.map(one, y0s, batch_size=_AT_ONCE)


def operations_of_a_step(scene: Scene) -> float:
    """Floating-point operations, as XLA counts them."""
    method = default_solver(scene)

    def step(t, h, y):
        return method.advance(scene.rate, t, h, y)

    zero = jnp.zeros(())
    analysis = jax.jit(step).lower(zero, zero, scene.y0).compile().cost_analysis()
    assert analysis is not None, "XLA counts no operations on this device"
    return float(analysis["flops"])
