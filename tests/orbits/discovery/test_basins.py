"""Basins: symmetric wells, the fractions that Attractors.jl's tests state, resuming, messages."""

import multiprocessing
from concurrent import futures

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import gap, refusal
from scipy.integrate import solve_ivp

import jaxdyn
import orbits

SIDE = np.linspace(-1.95, 1.95, 14)


def wells(t, y):
    return [y[1], y[0] - y[0] ** 3 - 0.3 * y[1]]


def unstable_wells(t, y):
    return [y[1], y[0] - y[0] ** 3 + 0.3 * y[1]]


def duffing(t, y):
    return [y[1], y[0] - y[0] ** 3 - 0.15 * y[1] + 0.2 * jnp.cos(t)]


def lorenz84(t, y):
    x, y, z = y
    a, b, f, g = 0.255, 4.0, 6.886, 1.347
    return [-(y**2) - z**2 - a * x + a * f, x * y - y - b * x * z + g, b * x * y + x * z - z]


def unstable(t, y):
    return [y[0]]


@pytest.fixture(scope="module")
def scene():
    return jaxdyn.ode(wells, [0.0, 0.0], 40.0, names=["x", "v"])


@pytest.fixture(scope="module")
def found(scene):
    return orbits.basins(scene, {"x": SIDE, "v": SIDE})


@pytest.mark.slow
def test_two_wells_share_the_plane(found):
    assert [a.kind for a in found.attractors] == ["equilibrium"] * 2
    places = sorted(a.points[0].round(12).tolist() for a in found.attractors)
    assert places == [[-1.0, 0.0], [1.0, 0.0]]
    assert found.fractions.tolist() == [0.5, 0.5, 0.0]
    # Where a start goes, by SciPy's integrator.
    from scipy.integrate import solve_ivp

    for i, j in ((0, 0), (3, 12), (9, 5), (13, 2)):
        end = solve_ivp(lambda t, y: np.array(wells(t, y)), (0, 120), (SIDE[i], SIDE[j]), rtol=1e-9)
        well = found.attractors[found.labels[i, j]].points[0]
        assert np.abs(end.y[:, -1] - well).max() < 1e-3
    assert "stable equilibrium at" in repr(found)
    # The flow keeps the symmetry y -> -y.
    assert (found.labels != found.labels[::-1, ::-1]).all()


@pytest.mark.slow
def test_refined_boundaries_are_those_of_a_fine_grid(scene, found):
    fine = orbits.basins(scene, {"x": SIDE, "v": SIDE}, refine=1)
    x, v = fine.axes
    full = orbits.basins(scene, {"x": x, "v": v})
    order = [
        int(np.argmin([abs(a.points - b.points).max() for b in full.attractors]))
        for a in fine.attractors
    ]
    same = np.take(order, fine.labels) == full.labels
    assert same.mean() > 0.97  # thin tongues that no coarse start has seen are missed
    assert fine.computed < full.computed
    assert fine.fractions.tolist() == found.fractions.tolist()


@pytest.mark.slow
def test_it_resumes(scene, found, tmp_path, monkeypatch):
    path = tmp_path / "basins.jsonl"
    monkeypatch.setattr("orbits.discovery.basins.CHUNK", 100)
    grid = {"x": SIDE, "v": SIDE}
    counts = []
    from jaxdyn.ensemble import engine

    run = engine.run

    def interrupted(scene, y0s, *args, **options):
        counts.append(len(y0s))
        if len(counts) == 2:
            raise KeyboardInterrupt
        return run(scene, y0s, *args, **options)

    monkeypatch.setattr(engine, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        orbits.basins(scene, grid, path=path)
    again = orbits.basins(scene, grid, path=path)
    assert counts[:3] == [100, 96, 96]
    assert np.array_equal(again.labels, found.labels)
    before, size = len(counts), path.stat().st_size
    same = orbits.basins(scene, grid, path=path)
    assert len(counts) == before  # all ends are known, also those of later rounds
    assert path.stat().st_size == size
    assert np.array_equal(same.labels, again.labels)
    other = {"x": SIDE[1:], "v": SIDE}
    assert "of another" in refusal(lambda: orbits.basins(scene, other, path=path))
    faster = jaxdyn.ode(unstable_wells, [0.0, 0.0], 40.0, names=["x", "v"])
    assert "of another" in refusal(lambda: orbits.basins(faster, grid, path=path))


@pytest.mark.slow
def test_an_executor_runs_the_chunks(scene, found, tmp_path, monkeypatch):
    monkeypatch.setattr("orbits.discovery.basins.CHUNK", 50)
    grid, path = {"x": SIDE, "v": SIDE}, tmp_path / "basins.jsonl"
    with futures.ThreadPoolExecutor(2) as pool:
        again = orbits.basins(scene, grid, path=path, executor=pool)
    assert np.array_equal(again.labels, found.labels)
    here = orbits.basins(scene, grid, path=path)  # all chunks are known
    assert np.array_equal(here.labels, found.labels)


@pytest.mark.slow
def test_processes_find_the_same(scene, found, monkeypatch):
    monkeypatch.setattr("orbits.discovery.basins.CHUNK", 100)
    monkeypatch.setattr("orbits.discovery.map_basins.CHUNK", 100)
    side = np.linspace(-2, 2, 18)[:-1]
    grid = {"x": side, "y": side}
    with futures.ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        again = orbits.basins(scene, {"x": SIDE, "v": SIDE}, executor=pool)
        mapped = orbits.map_basins(henon, grid, params=1.4, executor=pool)
    assert np.array_equal(again.labels, found.labels)
    assert np.array_equal(mapped.labels, orbits.map_basins(henon, grid, params=1.4).labels)


def test_basins_of_a_map_resume_bit_for_bit(tmp_path, monkeypatch):
    monkeypatch.setattr("orbits.discovery.map_basins.CHUNK", 50)
    side, path = np.linspace(-2, 2, 18)[:-1], tmp_path / "henon.jsonl"
    grid = {"x": side, "y": side}
    whole = orbits.map_basins(henon, grid, params=1.4, path=path)
    text = path.read_bytes()
    lines = text.splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:3]) + lines[3][:40])  # killed while it writes a line
    again = orbits.map_basins(henon, grid, params=1.4, path=path)
    assert path.read_bytes() == text
    assert np.array_equal(again.labels, whole.labels)
    assert np.array_equal(again.attractors[0].points, whole.attractors[0].points)
    plain = orbits.map_basins(henon, grid, params=1.4)
    assert np.array_equal(plain.labels, whole.labels)
    for options in ({"params": 1.3}, {"params": 1.4, "steps": 100}):
        refused = refusal(lambda o=options: orbits.map_basins(henon, grid, **o, path=path))
        assert "path: expected the file of this call" in refused
    path.write_bytes(text.replace(b"[", b" [", 1))
    assert "edited" in refusal(lambda: orbits.map_basins(henon, grid, params=1.4, path=path))


@pytest.mark.slow
def test_a_driven_oscillator_has_the_published_fractions(tmp_path):
    scene = jaxdyn.ode(duffing, [0.0, 0.0], 60 * np.pi, names=["x", "v"])
    side = np.linspace(-2.2, 2.2, 25)[:-1] + 2.2 / 24
    found = orbits.basins(scene, {"x": side, "v": side})
    assert [a.kind for a in found.attractors] == ["orbit", "orbit"]
    for a in found.attractors:
        assert a.orbit.period == pytest.approx(2 * np.pi, rel=1e-12)
        # The product of the multipliers is that of the damping.
        assert a.exponents.sum() == pytest.approx(-0.15, abs=1e-6)
    # Attractors.jl, test/mapping/attractor_mapping.jl: of 1000 random starts.
    published = np.array([0.489, 0.511])
    bar = 1.96 * np.sqrt(0.25 / 1000)
    assert (np.abs(np.sort(found.fractions[:2]) - published) < found.bars[:2] + bar).all()
    figure = found.plot(tmp_path / "basins.png")
    assert "stable orbit of period 6.28319" in figure.legends[0].get_texts()[0].get_text()


@pytest.mark.slow
def test_attractors_have_their_shortest_period():
    """The first motion to come near one of these orbits does so only every three periods."""

    def damped(t, y):
        x, v = y
        return [v, 0.2 * jnp.cos(t) - 0.15 * v + x - x**3]

    scene = jaxdyn.ode(damped, [0.0, 0.0], 60.0, names=["x", "v"])
    side = np.linspace(-2.0, 2.0, 10)
    found = orbits.basins(scene, {"x": side, "v": side})
    assert [gap(a.orbit.period, 2 * np.pi) < 1e-12 for a in found.attractors] == [True, True]
    assert [len(a.points) for a in found.attractors] == [1, 1]
    for one in found.attractors:
        end = solve_ivp(damped, (0.0, 2 * np.pi), one.orbit.y0, rtol=1e-12, atol=1e-13).y[:, -1]
        assert gap(end, one.orbit.y0) < 1e-9


@pytest.mark.slow
def test_an_equilibrium_an_orbit_and_chaos_side_by_side():
    scene = jaxdyn.ode(lorenz84, [0.0, 0.0, 0.0], 200.0, names=["x", "y", "z"])
    side = np.linspace(-3, 3, 9)[:-1] + 3 / 8
    found = orbits.basins(scene, {"x": side, "y": side, "z": side})
    by_kind = {a.kind: i for i, a in enumerate(found.attractors)}
    # As above; the numbers are those of "fixed point", "periodic" and "chaotic".
    for kind, share in {"equilibrium": 0.642, "orbit": 0.193, "chaotic": 0.165}.items():
        i = by_kind[kind]
        bar = 1.96 * np.sqrt(share * (1 - share) / 1000)
        assert abs(found.fractions[i] - share) < found.bars[i] + bar, kind
    assert found.fractions[-1] < 0.01


@pytest.mark.slow
def test_what_reaches_nothing_has_no_label():
    scene = jaxdyn.ode(unstable, [1.0], 5.0, names=["x"])
    found = orbits.basins(scene, {"x": [1.0, 2.0]}, rounds=1)
    assert found.labels.tolist() == [-1, -1]
    assert found.fractions.tolist() == [1.0]
    assert "two entries" in refusal(found.plot)


@pytest.mark.slow
def test_a_start_on_a_saddle_is_no_chaos():
    scene = jaxdyn.ode(wells, [0.0, 0.0], 40.0, names=["x", "v"])
    found = orbits.basins(scene, {"x": [-1.0, 0.0, 1.0]}, rounds=2)
    assert [a.kind for a in found.attractors] == ["equilibrium"] * 2
    assert found.labels.tolist() == [0, -1, 1]


@pytest.mark.slow
def test_orbits_of_a_conservative_scene_attract_nothing():
    swing = jaxdyn.scenes.pendulum(t1=10.0)
    found = orbits.basins(swing, {"theta": [0.1, 0.7]}, rounds=2)
    assert found.attractors == ()
    assert found.labels.tolist() == [-1, -1]
    assert "none within 20 s" in repr(found)
    assert "rounds= lets those that reach none run longer" in repr(found)


def test_a_map_that_keeps_areas_has_no_attractor():
    def turn(y):
        return [np.cos(1) * y[0] - np.sin(1) * y[1], np.sin(1) * y[0] + np.cos(1) * y[1]]

    def standard(y):  # chaotic, but a sea and not an attractor
        v = y[1] + 3.0 * jnp.sin(y[0])
        return [jnp.mod(y[0] + v, 2 * np.pi), jnp.mod(v, 2 * np.pi)]

    side = np.linspace(-1.0, 1.0, 3)
    for step in (turn, standard):
        found = orbits.map_basins(step, {"x": side, "y": side + 2.0}, steps=500)
        assert found.attractors == ()
        assert "none within 1500 steps" in repr(found)


def newton(y):
    """A step of Newton's method for z^3 = 1."""
    z = jax.lax.complex(y[0], y[1])
    z = z - (z**3 - 1) / (3 * z**2)
    return [z.real, z.imag]


def henon(y, a):
    return [1 - a * y[0] ** 2 + y[1], 0.3 * y[0]]


def test_newtons_method_has_three_basins_that_turn_into_each_other():
    side = np.linspace(-1.97, 1.97, 40)
    found = orbits.map_basins(newton, {"x": side, "y": side})
    roots = np.exp(2j * np.pi * np.arange(3) / 3)
    places = np.array([a.points[0] @ [1, 1j] for a in found.attractors])
    assert [a.kind for a in found.attractors] == ["fixed point"] * 3
    assert np.abs(places[:, None] - roots[None]).min(axis=1).max() < 1e-12
    # Where each start goes, by complex numbers of NumPy.
    z = side[:, None] + 1j * side[None, :]
    for _ in range(300):
        z = z - (z**3 - 1) / (3 * z**2)
    assert np.abs(places[found.labels] - z).max() < 1e-9
    upper, lower = np.argmax(places.imag), np.argmin(places.imag)
    assert found.fractions[upper] == found.fractions[lower]  # the mirror image
    assert found.fractions.sum() == pytest.approx(1)


def test_henons_map_has_the_published_fraction_and_exponent(tmp_path):
    side = np.linspace(-2, 2, 101)[:-1] + 0.02
    found = orbits.map_basins(henon, {"x": side, "y": side}, params=1.4)
    (chaos,) = found.attractors
    assert chaos.kind == "chaotic"
    assert abs(chaos.exponents[0] - 0.4192) < 2 * chaos.bars[0]  # Sprott (2003), appendix A
    assert chaos.exponents.sum() == pytest.approx(np.log(0.3), abs=1e-9)
    # Attractors.jl, test/mapping/attractor_mapping.jl: 0.451 of 1000 random starts.
    bar = 1.96 * np.sqrt(0.25 / 1000)
    assert abs(found.fractions[0] - 0.451) < found.bars[0] + bar
    assert found.fractions[0] + found.fractions[1] == pytest.approx(1)
    figure = found.plot(tmp_path / "henon.png")
    assert figure.axes[0].get_title() == "henon"


def test_many_attractors_of_a_map_are_found_among_motions_that_drift_away():
    # Fixed points at each odd multiple of pi. The first starts of the grid drift, turn by turn.
    def damped(y, p):
        return [y[0] + y[1], 0.9 * y[1] + p * jnp.sin(y[0] + y[1])]

    side = np.arange(14) * np.pi / 7
    found = orbits.map_basins(damped, {"x": side, "v": side - np.pi}, params=3.5)
    x, v = np.meshgrid(side, side - np.pi, indexing="ij")
    for _ in range(int(found.time)):
        x, v = x + v, 0.9 * v + 3.5 * np.sin(x + v)
    near = np.pi * (1 + 2 * np.round((x / np.pi - 1) / 2))
    rest = np.abs(x - near) + np.abs(v) < 1e-3
    # Single starts may go elsewhere in NumPy: motions are chaotic at first, and rounding decides.
    assert abs(np.mean(found.labels >= 0) - np.mean(rest)) < 0.05
    places = np.array([a.points[0, 0] for a in found.attractors])
    assert len(places) > 0.9 * len(np.unique(near[rest]))
    odd = places / np.pi
    np.testing.assert_allclose(odd, 1 + 2 * np.round((odd - 1) / 2), rtol=1e-12)


def test_a_cycle_of_a_map_has_its_period_and_multiplier():
    side = np.linspace(-1, 1, 12)
    found = orbits.map_basins(henon, {"x": side, "y": side}, params=0.6)
    (cycle,) = found.attractors
    assert (cycle.kind, len(cycle.points)) == ("cycle", 2)
    assert "stable cycle of period 2" in repr(found)
    # Both points solve a^2 x^2 - (1 - b) a x + (1 - b)^2 - a = 0, by the second iterate.
    a, b = 0.6, 0.3
    x = np.sort(np.roots([a**2, -(1 - b) * a, (1 - b) ** 2 - a]))
    np.testing.assert_allclose(np.sort(cycle.points[:, 0]), x, atol=1e-12)
    slopes = [np.array([[-2 * a * p, 1], [b, 0]]) for p in cycle.points[:, 0]]
    size = np.abs(np.linalg.eigvals(slopes[1] @ slopes[0]))
    np.testing.assert_allclose(np.exp(2 * cycle.exponents), np.sort(size)[::-1], atol=1e-12)


def cubic(y, p):
    """Steps of x' = p + x - x^3, which has a fold at p = 2 / 27^(1/2) = 0.385."""
    return [y[0] + 0.1 * (p + y[0] - y[0] ** 3)]


def test_an_attractor_that_ends_at_a_fold_is_a_tipping_point(tmp_path):
    grid, values = {"x": np.linspace(-2.0, 2.0, 40)}, [-0.5, -0.3, 0.0, 0.2, 0.37, 0.4, 0.5]
    found = orbits.basin_fractions(
        lambda p: orbits.map_basins(cubic, grid, params=p, steps=2000), values
    )
    assert [tuple(point) for point in found.tipping] == [
        (1, True, -0.5, -0.3),
        (0, False, 0.37, 0.4),
    ]
    middle = np.flatnonzero(found.values == 0.0)[0]
    assert found.fractions[middle].tolist() == [0.5, 0.5, 0.0]
    assert found.fractions.sum(axis=1) == pytest.approx(np.ones(7))
    for p, low, high in zip(found.values, *found.attractors, strict=True):
        roots = np.roots([-1, 0, 1, p])
        real = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
        for one, place in ((low, real[0]), (high, real[-1])):
            assert one is None or one.points[0, 0] == pytest.approx(place, abs=1e-9)
    assert "attractor 0 ends between 0.37 and 0.4" in repr(found)
    figure = found.plot(tmp_path / "tipping.png")
    assert figure.axes[0].get_ylabel() == "fraction of the starts [%]"


def test_misuse_of_maps_is_refused():
    side = {"x": [0.0, 1.0]}

    def of_map(step, grid=side, **options):
        return refusal(lambda: orbits.map_basins(step, grid, **options))

    assert "step: expected shape (1,)" in of_map(lambda y: [y[0], y[0]])
    assert "step: expected a function of (y)" in of_map(cubic)
    assert "values of entries by name" in of_map(newton, [1.0])
    assert "steps" in of_map(newton, {"x": [0.0], "y": [1.0]}, steps=0)

    def along(find, values, **options):
        return refusal(lambda: orbits.basin_fractions(find, values, **options))

    assert "values: expected ascending" in along(lambda p: None, [1.0, 0.0])
    assert "find: expected a function that returns basins" in along(lambda p: None, [0.0])
    assert "within" in along(lambda p: None, [0.0], within=0.0)
    assert "find: expected a function of (value)" in along(lambda *, p: None, [0.0])

    def other(p):
        grid = {"x": [0.5]} if p < 0.5 else {"y": [0.5]}
        return orbits.map_basins(cubic, grid, params=p)

    assert "find: expected basins in" in along(other, [0.0, 1.0])
    one = orbits.basin_fractions(lambda p: orbits.map_basins(cubic, side, params=p), [0.0])
    assert "found: expected at least two values" in refusal(one.plot)


def test_misuse_is_refused(scene):
    def refused(grid, **options):
        return refusal(lambda: orbits.basins(scene, grid, **options))

    assert "values of entries by name" in refused([1.0])
    assert "values of entries by name" in refused({})
    assert "grid: expected one of v, x" in refused({"z": [1.0]})
    assert "at least one value" in refused({"x": []})
    assert "finite" in refused({"x": [np.nan]})
    assert "a grid of two entries" in refused({"x": [1.0]}, refine=1)
    assert "rounds" in refused({"x": [1.0]}, rounds=0)
    assert "t1" in refused({"x": [1.0]}, t1=0.0)
