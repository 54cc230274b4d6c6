"""Motions as data frames of pandas: every sample, by time and by name."""

import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import refusal

from jaxdyn import Trajectory, scenes, simulate
from jaxdyn.integrate.phases import HybridTrajectory
from jaxdyn.status import Status


def made(scene, ts) -> Trajectory:
    """A motion that nobody computed."""
    ts = jnp.asarray(ts, float)
    ys = scene.y0[None] + ts[:, None]
    zero = jnp.asarray(0)
    return Trajectory(scene, ts=ts, ys=ys, steps=zero, rejected=zero, status=zero)


def chain(ended: bool) -> HybridTrajectory:
    """A motion whose second phase has other coordinates."""
    first, last = made(scenes.cannonball(), [0.0, 1.0]), made(scenes.pendulum(), [1.0, 2.0, 3.0])
    return HybridTrajectory(
        names=("fly", "swing"),
        pieces=(first, last),
        t=jnp.asarray(3.0),
        y=jnp.array([7.0, 8.0]),
        ended=ended,
        status=Status.OK,
        path=(("fly", 0), ("swing", 0)),
    )


@pytest.fixture
def pandas():
    return pytest.importorskip("pandas", reason="pandas is not installed")


def test_a_row_is_a_sample_and_a_column_an_entry(pandas):
    motion = made(scenes.cannonball(), [0.0, 0.5, 1.0])
    frame = motion.to_pandas()
    assert (frame.index.name, [*frame.columns]) == ("t", ["x", "y", "vx", "vy"])
    assert frame.attrs["units"] == {"t": "s", "x": "m", "y": "m", "vx": "m/s", "vy": "m/s"}
    assert np.array_equal(frame.index, motion.ts)
    assert np.array_equal(frame.to_numpy(), motion.ys)
    assert frame["x"][0.5] == motion["x"][1]
    assert made(scenes.lorenz(), [0.0]).to_pandas().attrs["units"]["t"] == "1"


def test_what_was_not_reached_is_nan(pandas):
    lost = simulate(scenes.cannonball(speed=1e200, drag=1.0), samples=3, throw=False)
    assert lost.to_pandas().isna().to_numpy()[-1].all()


def test_a_batch_is_numbered_along_its_axes(pandas):
    times = jnp.array([[[0.0, 1.0], [0.0, 2.0], [0.0, 3.0]]] * 2)
    batch = jax.vmap(jax.vmap(lambda ts: made(scenes.pendulum(), ts)))(times)
    frame = batch.to_pandas()
    assert frame.index.names == ["motion 0", "motion 1", "t"]
    assert frame.shape == (12, 2)
    assert np.array_equal(frame.loc[(1, 2)], batch.one(1, 2).ys)
    assert np.array_equal(frame.loc[(1, 2)].index, [0.0, 3.0])
    line = jax.vmap(lambda ts: made(scenes.pendulum(), ts))(times[0]).to_pandas()
    assert line.index.names == ["motion", "t"]
    assert line.loc[1].attrs["units"] == {"t": "s", "theta": "rad", "theta_dot": "rad/s"}


def test_phases_are_a_column_and_the_state_after_the_last_exit_is_there(pandas):
    frame = chain(ended=True).to_pandas()
    assert [*frame["phase"]] == ["fly"] * 2 + ["swing"] * 3 + ["end"]
    assert [*frame.columns] == ["x", "y", "vx", "vy", "theta", "theta_dot", "phase"]
    assert frame["x"].isna().tolist() == [False] * 2 + [True] * 4
    assert [*frame["theta"]][2:] == [2.0, 3.0, 4.0, 7.0]
    assert [*frame.index] == [0.0, 1.0, 1.0, 2.0, 3.0, 3.0]
    assert frame.attrs["units"]["theta_dot"] == "rad/s"
    assert [*chain(ended=False).to_pandas()["phase"]] == ["fly"] * 2 + ["swing"] * 3


def test_traced_values_are_refused(pandas):
    with pytest.raises(ValueError, match=r"motion: expected numbers, got values traced"):
        jax.jit(lambda m: m.to_pandas())(made(scenes.pendulum(), [0.0]))


def test_without_pandas_a_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)  # as if it could not be found
    said = "to_pandas: expected the package pandas, got none. Install it: pip install "
    assert refusal(made(scenes.pendulum(), [0.0]).to_pandas) == f"{said}'jaxdyn[pandas]'."
