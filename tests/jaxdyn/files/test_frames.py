"""Motions and other results in pandas and xarray: every number, with its name and unit."""

import math
import sys
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import refusal

import jaxdyn
from jaxdyn import Trajectory, ensemble, scenes, simulate
from jaxdyn.chaos.maps import ChaosMap
from jaxdyn.integrate.phases import HybridTrajectory
from jaxdyn.status import Status
from orbits.families.family import Family
from orbits.sections.tables import SectionPoints


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


@pytest.fixture
def xarray(pandas):
    return pytest.importorskip("xarray", reason="xarray is not installed")


def test_a_motion_is_a_data_set_along_time(xarray):
    motion = made(scenes.cannonball(), [0.0, 0.5, 1.0])
    data = motion.to_xarray()
    assert data.sizes == {"t": 3}
    assert data["t"].attrs["units"] == "s"
    assert data["vx"].attrs["units"] == "m/s"
    assert float(data["y"].sel(t=0.5)) == motion["y"][1]
    assert set(data.data_vars) == {"x", "y", "vx", "vy"}


def test_a_batch_is_a_data_set_along_motions_and_samples(xarray):
    times = jnp.array([[0.0, 1.0], [0.0, 2.0], [0.0, 3.0]])
    batch = jax.vmap(lambda ts: made(scenes.pendulum(), ts))(times)
    data = batch.to_xarray()
    assert data.sizes == {"motion": 3, "sample": 2}
    assert np.array_equal(data["t"], times)
    assert np.array_equal(data["theta"].isel(motion=2), batch.one(2)["theta"])


def test_phases_are_a_coordinate(xarray):
    data = chain(ended=True).to_xarray()
    assert [*data["phase"].values] == ["fly"] * 2 + ["swing"] * 3 + ["end"]
    assert data["theta"].attrs["units"] == "rad"
    assert data["x"].isnull().to_numpy().tolist() == [False] * 2 + [True] * 4


def test_the_ends_of_an_ensemble_have_the_names_of_its_scene(xarray):
    y1, codes = jnp.array([[1.0, 2.0], [3.0, 4.0]]), jnp.array([0, 1])
    ends = ensemble.lanes.Ends(y1, jnp.array([5.0, 6.0]), codes, codes, codes, ())
    frame, data = ends.to_pandas(scenes.pendulum()), ends.to_xarray(scenes.pendulum())
    assert frame.index.name == "motion"
    assert frame["theta_dot"].tolist() == [2.0, 4.0] == data["theta_dot"].values.tolist()
    assert frame["status"].tolist() == [0, 1]
    assert frame["t"].tolist() == [5.0, 6.0] == data["t"].values.tolist()
    assert frame.attrs["units"] == {"t": "s", "theta": "rad", "theta_dot": "rad/s"}


def test_a_map_has_its_numbers_as_coordinates(xarray):
    grid = np.arange(6.0).reshape(2, 3)
    chart = ChaosMap(np.array([1.0, 2.0]), np.array([3.0, 4.0, 5.0]), grid, grid, grid, grid)
    frame, data = chart.to_pandas(), chart.to_xarray()
    assert frame.index.names == ["first", "second"]
    assert frame.loc[(2.0, 4.0), "mean"] == 4.0 == float(data["mean"].sel(first=2.0, second=4.0))


def test_a_section_repeats_what_belongs_to_a_start(xarray):
    scene, ys = scenes.double_pendulum(), np.arange(24.0).reshape(2, 3, 4)
    points = SectionPoints(
        *(scene, None, ("theta2", "momentum"), np.full((2, 3, 2), 0.5), ys[..., 0], ys),
        *(np.ones((2, 3)), np.array([3, 3]), np.array([0, 0])),
        *(np.array([-1.0, -2.0]), np.array([1e-14, 2e-14])),
    )
    frame, data = points.to_pandas(), points.to_xarray()
    assert frame.index.names == ["start", "crossing"]
    assert frame["energy"].tolist() == [-1.0] * 3 + [-2.0] * 3
    assert frame["theta1"].tolist() == ys[..., 0].ravel().tolist()
    assert frame["theta2"].tolist() == [0.5] * 6  # the section's, between -pi and pi
    assert frame.attrs["units"]["energy"] == "J"
    assert "momentum" not in frame.attrs["units"]  # what the user computes has a unit of its own
    assert data["energy"].dims == ("start",)


def test_families_are_tables_of_their_members(xarray):
    scene = scenes.pendulum()
    orbits = [SimpleNamespace(scene=scene, period=p, y0=np.array([p, 0.0])) for p in (1.0, 2.0)]
    verdict = SimpleNamespace(verdict="stable")
    members = tuple(
        SimpleNamespace(orbit=orbit, parameter=0.5, energy=3.0, stability=verdict)
        for orbit in orbits
    )
    in_energy = [SimpleNamespace(**vars(one) | {"parameter": math.nan}) for one in members]
    assert "parameter" not in Family(tuple(in_energy), (), "", None).to_pandas().columns
    frame = Family(members, (), "", None).to_pandas()
    assert frame["parameter"].tolist() == [0.5, 0.5]
    assert frame["period"].tolist() == [1.0, 2.0] == frame["theta"].tolist()
    assert frame["verdict"].tolist() == ["stable"] * 2
    assert frame.attrs["units"]["period"] == "s"

    def make(parameter):
        return jaxdyn.ode(lambda t, y, a: a - y**2, [1.0], 1.0, params=parameter)

    family = jaxdyn.continue_equilibria(make, 1.0, [1.0], within=(0.5, 2.0))
    data = family.to_xarray()
    ((name, _),) = make(1.0).labels()
    assert data.sizes == {"member": len(family.members)}
    np.testing.assert_allclose(data[name] ** 2, data["parameter"], rtol=1e-12)


def test_without_xarray_a_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    said = "to_xarray: expected the package xarray, got none. Install it: pip install "
    assert refusal(made(scenes.pendulum(), [0.0]).to_xarray) == f"{said}'jaxdyn[xarray]'."
