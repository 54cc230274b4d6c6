"""Stable and unstable manifolds: against closed forms, symmetry, energy, and their own error."""

import json
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.analysis.energy import energy
from jaxdyn.integrate.events import Reaches, When

MU = 0.01215
#: A planar Lyapunov orbit about L1 of Earth and Moon, begun from four digits.
START, PERIOD = (0.826918, 0.00386854, 0.00316954, 0.0908955), 2.7176


@pytest.fixture(scope="module")
def upright():
    return scenes.pendulum().starting([math.pi, 0.0])


@pytest.fixture(scope="module")
def lyapunov():
    return orbits.find(scenes.restricted_three_body(mu=MU), START, PERIOD, hold="x")


@pytest.fixture(scope="module")
def tubes(lyapunov):
    moon = Reaches(0, 1 - MU)
    return [
        orbits.manifold(lyapunov, kind, until=moon, strands=8, branch="+", samples=5)
        for kind in ("unstable", "stable")
    ]


def separatrix(theta, w):
    """Speed on the separatrix of a pendulum: (dtheta/dt)^2 = 2 w^2 (1 + cos(theta))."""
    return 2 * w * np.abs(np.cos(theta / 2))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["stable", "unstable"])
def test_the_separatrix_of_a_pendulum(upright, kind):
    found = orbits.manifold(upright, kind, time=3.0)
    w = abs(found.multipliers[0])
    theta, speed = np.moveaxis(found.samples, -1, 0)
    # theta - pi and the speed grow alike near the start, where the error is that of the start.
    miss = np.abs(np.abs(speed) - separatrix(theta, w))
    assert miss[:, 0].max() < 2 * (1 + w) * found.linear_error
    # In units of speed an error of the start changes v^2 by less than 2 v times itself.
    assert miss.max() < 100 * found.linear_error
    assert found.ok.all()
    assert found.branches.tolist() == [1, -1]
    assert np.abs(np.sign(found.ts) - (1 if kind == "unstable" else -1)).max() == 0
    assert "<img" in found._repr_html_()


@pytest.mark.slow
def test_tubes_of_a_lyapunov_orbit_reach_the_section_with_the_energy_of_the_orbit(lyapunov, tubes):
    of = jax.vmap(lambda y: energy(lyapunov.scene, 0.0, y))
    level = float(energy(lyapunov.scene, 0.0, lyapunov.y0))
    for tube in tubes:
        assert tube.ok.all()
        np.testing.assert_allclose(tube.ends[:, 0], 1 - MU, rtol=0, atol=1e-12)
        # The energy is stationary along the manifold: it changes by the error of the start.
        np.testing.assert_allclose(of(jnp.asarray(tube.ends)), level, rtol=0, atol=1e-8)
        np.testing.assert_allclose(tube.samples[:, -1], tube.ends, rtol=0, atol=1e-6)


@pytest.mark.slow
def test_strands_last_from_their_starts_to_a_section_away_from_the_orbit(lyapunov):
    def behind(t, y):  # y = 0, but not at the orbit, which crosses it at x = 0.83
        del t
        return jnp.where(y[0] < 0, y[1], 1.0)

    def rate(t, s):
        x, y, u, v = s
        a, b = (((x - at) ** 2 + y * y) ** 1.5 for at in (-MU, 1 - MU))
        ax = 2 * v + x - (1 - MU) * (x + MU) / a - MU * (x - 1 + MU) / b
        return [u, v, ax, -2 * u + y - (1 - MU) * y / a - MU * y / b]

    found = orbits.manifold(
        lyapunov, "unstable", until=When(behind, -1), branch="-", strands=6, time=12.0, samples=2
    )
    assert found.ok.all()
    assert len(set(found.t0s)) == 6
    for y0, duration, end in zip(found.starts, found.durations, found.ends, strict=True):
        by = solve_ivp(rate, (0, duration), y0, method="DOP853", rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(by.y[:, -1], end, rtol=0, atol=1e-9)
        assert end[0] < 0


@pytest.mark.slow
def test_the_stable_tube_is_the_mirror_image_of_the_unstable_one(lyapunov, tubes):
    # (x, y, vx, vy, t) -> (x, -y, -vx, vy, -t) takes one manifold of a symmetric orbit to the
    # other; phases differ, so closed curves on the section are compared by their areas.
    unstable, stable = (tube.ends[:, [1, 3]] for tube in tubes)
    areas = [
        0.5 * np.abs(np.sum(c[:, 0] * np.roll(c[:, 1], -1) - c[:, 1] * np.roll(c[:, 0], -1)))
        for c in (unstable, stable)
    ]
    assert abs(areas[0] / areas[1] - 1) < 0.1  # polygons of eight corners
    assert (unstable[:, 0].mean() < 0) != (stable[:, 0].mean() < 0)


@pytest.mark.slow
def test_the_error_of_the_starts_is_that_which_was_asked_for(lyapunov):
    # A manifold to 1e-10 from a tenth of the step: its strands pass close to the coarser starts.
    fine, coarse = (
        orbits.manifold(lyapunov, "unstable", strands=3, branch="+", error=e, time=1.0, samples=2)
        for e in (1e-10, 1e-6)
    )
    assert fine.linear_error <= 1e-10
    assert coarse.linear_error <= 1e-6
    assert abs(coarse.step_off / fine.step_off / 100 - 1) < 0.05  # as the square of the step


@pytest.mark.slow
def test_the_stable_surface_of_the_origin_of_lorenz():
    origin = scenes.lorenz().starting([0.0, 0.0, 0.0])
    found = orbits.manifold(origin, "stable", strands=6, time=0.1, samples=2)
    assert len(found) == 6
    values, vectors = np.linalg.eig(jaxdyn.linearize(origin, origin.y0).jacobian)
    up = int(np.argmax(values))
    np.testing.assert_allclose(np.sort(found.multipliers), np.sort(np.delete(values, up)))
    # Forwards what is off the surface grows as exp(11.8 t), and the rest decays.
    for y in found.starts:
        end = jaxdyn.simulate(origin.starting(y), 0.5, samples=2, rtol=1e-13).ys[-1]
        off = abs(np.linalg.inv(vectors)[up] @ np.asarray(end)) * math.exp(-values[up] * 0.5)
        assert off < 3 * found.linear_error


@pytest.mark.parametrize("shear", [0.0, 1.0])
def test_equal_eigenvalues_have_the_whole_plane(shear):
    # One eigenvector was taken twice; with a shear there is only one.
    def rate(t, y):
        return [y[0] + shear * y[1], y[1], 2 * y[0] - y[2]]

    saddle = jaxdyn.ode(rate, [0.0, 0.0, 0.0], names=["x", "y", "z"])
    found = orbits.manifold(saddle, "unstable", strands=6, time=0.5, samples=2)
    x, y, z = found.starts.T / found.step_off
    plane = x - shear * y / 2  # z of the plane, which the flow keeps
    np.testing.assert_allclose(z, plane, atol=1e-6)
    assert np.linalg.matrix_rank(found.starts, 0.1 * found.step_off) == 2


def test_strands_that_miss_the_section_have_a_status_and_no_end(lyapunov):
    far = Reaches(0, 10.0)
    found = orbits.manifold(
        lyapunov, "unstable", until=far, time=1.0, strands=8, branch="+", samples=5
    )
    assert not found.ok.any()
    assert np.isnan(found.ends).all()
    assert "Raise `time`" in found.message
    assert found.durations == pytest.approx(1.0)  # t0s differ, from 0 to the period


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"kind": "centre"}, "kind: expected"),
        ({"branch": "up"}, "branch: expected"),
        ({"error": 0.0}, "error: expected > 0"),
        ({"time": -1.0}, "time: expected > 0"),
        ({"until": 3.0}, "until: expected an event"),
        ({"which": 1}, "expected 2 unstable eigenvalues or more"),
    ],
)
def test_misuse_is_refused(upright, options, said):
    with pytest.raises(ValueError, match=said):
        orbits.manifold(upright, **({"kind": "unstable"} | options))


@pytest.mark.slow
def test_states_that_move_and_stable_orbits_are_refused():
    with pytest.raises(ValueError, match="expected an equilibrium"):
        orbits.manifold(scenes.pendulum(), "unstable")
    swing = orbits.find(scenes.pendulum(angle=1.0), period=2.1)
    with pytest.raises(ValueError, match="expected 1 unstable multiplier or more"):
        orbits.manifold(swing, "unstable")


def test_an_error_below_rounding_is_refused_with_a_remedy(lyapunov):
    with pytest.raises(orbits.SearchError, match="larger error"):
        orbits.manifold(lyapunov, "unstable", strands=2, error=1e-17)


@pytest.mark.slow
def test_command_and_picture(lyapunov, tmp_path, command):
    saved, picture = tmp_path / "lyapunov.json", tmp_path / "tubes.png"
    orbits.save(saved, lyapunov)
    words = ["manifold", saved, "--until", "x=0.98785", "--strands", 8, "--branch", "+"]
    found = json.loads(command("orbits", *words, "--json", "--plot", picture).out)["manifolds"]
    assert [one["kind"] for one in found] == ["unstable", "stable"]
    for one in found:
        np.testing.assert_allclose(np.array(one["ends"])[:, 0], 1 - MU, rtol=0, atol=1e-12)
    assert picture.stat().st_size > 10_000


def test_a_section_that_is_no_entry_is_refused(lyapunov, tmp_path, command):
    saved = tmp_path / "lyapunov.json"
    orbits.save(saved, lyapunov)
    for text in ("x", "q=1"):
        code, _, err = command("orbits", "manifold", saved, "--until", text)
        assert code == 2
        assert "--until: expected" in err


@pytest.mark.slow
def test_a_tube_in_space_is_drawn_with_its_orbit(tubes):
    ax = orbits.drawing.manifold(tubes, entries=("x", "y", "vx"), title="").axes[0]
    assert ax.name == "3d"
    labels = [line.get_label() for line in ax.get_lines() if line.get_label()[0] != "_"]
    assert labels == ["unstable manifold", "stable manifold", "orbit"]
    with pytest.raises(ValueError, match="two or three names"):
        orbits.drawing.manifold(tubes, entries=("x",))


@pytest.mark.slow
def test_numbers_are_printed(tubes):
    text = str(tubes[0])
    for part in ("Unstable manifold of orbit of restricted_three_body", "multiplier", "step-off"):
        assert part in text
