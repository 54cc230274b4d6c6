"""Ensembles: every motion is that of `simulate`, whatever runs beside it, and none waits."""

import resource
import subprocess
import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, gap, kepler, run_python

from jaxdyn import Scene, ensemble, ode, scenes
from jaxdyn.effects import LinearDrag, PairGravity, QuadraticDrag
from jaxdyn.ensemble import batches, engine, watches
from jaxdyn.ensemble.batches import _on_one_device
from jaxdyn.ensemble.lanes import WIDTH
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.events import Reaches
from jaxdyn.integrate.march import Watch
from jaxdyn.integrate.simulation import solve
from jaxdyn.scenes import catalogue
from jaxdyn.solvers import NYSTROM12, RADAU9, VERNER9
from jaxdyn.status import Status

RTOL = 1e-12
N = WIDTH + 9  # some lanes get a second motion


@pytest.fixture(params=["cpu", "gpu"])
def device(request, monkeypatch):
    """Ensembles run as they do on a kind of device: on a GPU all lanes start together."""
    monkeypatch.setattr(engine, "device_kind", lambda devices: request.param)
    monkeypatch.setattr(batches, "_ROWS", 2 * WIDTH)
    monkeypatch.setattr(batches, "_ENTRIES", 0)  # no more rows than on a CPU


def near_eight(n):
    """The figure-eight and n starts within a hundredth of it."""
    scene = scenes.three_body()
    noise = np.random.default_rng(3).standard_normal((n, 12))
    return scene, np.asarray(scene.y0) + 0.01 * noise


def one_by_one(scene, y0s, t1s):
    return [solve(scene.starting(y), t, rtol=RTOL) for y, t in zip(y0s, t1s, strict=True)]


@pytest.mark.usefixtures("device")
def test_every_motion_is_that_of_simulate():
    scene, y0s = near_eight(N)
    t1s = np.random.default_rng(4).uniform(0.5, 4.0, N)
    t1s[::3] *= -1
    t1s[5] = 0.0
    out = ensemble.run(scene, y0s, t1s, rtol=RTOL)
    alone = one_by_one(scene, y0s, t1s)
    assert out.ok.all()
    np.testing.assert_array_equal(out.t, t1s)
    np.testing.assert_array_equal(out.y1[5], y0s[5])
    assert gap(out.y1, np.array([a.y1 for a in alone])) < SOLVED
    # The same step control, but for the first step, which diffrax sets to 0.01 for `simulate`.
    assert gap(out.steps, [int(a.steps) for a in alone]) <= 2
    assert out.rejected.max() <= 1


def zoo_gap(name):
    scene = catalogue.entries()[name].make()
    t1s = min(0.5, float(scene.t1)) * np.array([1.0, 0.7, -0.4])
    y0s = np.tile(scene.y0, (3, 1))
    out = ensemble.run(scene, y0s, t1s, rtol=RTOL)
    expected = np.array([a.y1 for a in one_by_one(scene, y0s, t1s)])
    return gap(out.y1, expected) / max(1.0, np.abs(expected).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cannonball", "satellite"])
def test_scenes_with_drag_and_with_projection(name):
    assert zoo_gap(name) < SOLVED


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(catalogue.entries()))
def test_every_scene_of_the_zoo(name):
    assert zoo_gap(name) < SOLVED


@pytest.mark.slow
def test_a_pair_of_choice_is_used():
    scene, y0s = near_eight(2)
    general = ensemble.run(scene + LinearDrag(0.0), y0s, 1.0, rtol=RTOL)
    special = ensemble.run(scene, y0s, 1.0, rtol=RTOL, solver=NYSTROM12)
    assert gap(general.y1, special.y1) < SOLVED
    assert (general.steps != special.steps).all()


def test_the_result_does_not_depend_on_order_or_split():
    scene, y0s = near_eight(N)
    out = ensemble.run(scene, y0s, 3.0)
    order = np.random.default_rng(5).permutation(N)
    shuffled = ensemble.run(scene, y0s[order], 3.0)
    np.testing.assert_array_equal(shuffled.y1, out.y1[order])
    np.testing.assert_array_equal(ensemble.run(scene, y0s[7:9], 3.0).y1, out.y1[7:9])
    small = ensemble.run(scene, y0s, 3.0, chunk=10)  # another program
    np.testing.assert_array_equal(small.steps, out.steps)
    assert gap(small.y1, out.y1) < SOLVED


def test_fixed_numbers_give_the_same_motions():
    scene, y0s = near_eight(N)
    out = ensemble.run(scene, y0s, 2.0, rtol=RTOL)
    fixed = ensemble.run(scene, y0s, 2.0, rtol=RTOL, fixed=True)
    assert gap(fixed.y1, out.y1) < SOLVED
    parts = ensemble.stream(scene, [y0s[:5], y0s[5:]], 2.0, rtol=RTOL, fixed=True)
    assert gap(np.concatenate([part.y1 for part in parts]), fixed.y1) == 0.0


def test_fixed_numbers_are_those_that_all_motions_share():
    made = jax.vmap(lambda drag: scenes.cannonball(drag=drag))(jnp.array([0.1, 0.2]))
    with pytest.raises(ValueError, match="fixed: expected numbers that all motions share"):
        ensemble.run(scenes.cannonball(drag=0.1), params=made, t1=0.5, fixed=True)


@pytest.mark.slow
def test_any_number_of_the_scene_may_differ():
    drags = np.linspace(0.0, 0.3, N)
    scene = scenes.cannonball(drag=0.1)
    params = jax.vmap(lambda c: scenes.cannonball(drag=c))(drags)
    out = ensemble.run(scene, t1=1.0, params=params, rtol=RTOL)
    each = [scene.without(QuadraticDrag) + QuadraticDrag(c) for c in drags]
    expected = [solve(one, 1.0, rtol=RTOL).y1 for one in each]
    assert gap(out.y1, np.array(expected)) < SOLVED * 100  # entries up to 100
    one = eqx.tree_at(lambda s: s.effects[1].c, scene, drags)
    same = ensemble.run(scene, np.tile(scene.y0, (N, 1)), 1.0, params=one, rtol=RTOL)
    assert gap(same.y1, out.y1) < SOLVED * 100
    own_span = ensemble.run(scene, params=params, rtol=RTOL)
    np.testing.assert_array_equal(own_span.t, params.t1)


@pytest.mark.usefixtures("device")
def test_what_fails_has_a_status_and_nan_and_leaves_the_others_alone():
    scene = Scene(FreePoints([1.0, 1.0]), (PairGravity(1.0),), y0=[0, 0, 1, 0, 0, 0.5, 0, -0.5])
    y0s = np.tile(scene.y0, (N, 1))
    y0s[3, 4:] = 0.0  # they fall upon each other
    y0s[4, 2] = np.nan
    out = ensemble.run(scene, y0s, 2.0, rtol=RTOL)
    expected = np.full(N, int(Status.OK))
    expected[3], expected[4] = Status.STEP_COLLAPSED, Status.NOT_FINITE
    np.testing.assert_array_equal(out.status, expected)
    bad = ~out.ok
    assert np.isnan(out.y1[bad]).all()
    assert out.t[3] == pytest.approx(np.pi / 4, rel=1e-6)  # free fall from rest at distance 1
    assert (out.y1[~bad] == out.y1[0]).all()
    assert "1 motion: The step size fell" in out.message
    assert f"{N - 2} motions: The integration reached" in out.message
    few = ensemble.run(scene, y0s[:2], 2.0, rtol=RTOL, max_steps=3)
    np.testing.assert_array_equal(few.status, [Status.STEP_LIMIT] * 2)
    np.testing.assert_array_equal(few.steps + few.rejected, [3, 3])
    assert np.isnan(few.y1).all()


def test_new_numbers_and_other_counts_do_not_compile_again():
    scene, y0s = near_eight(N)
    ensemble.run(scene, y0s, 0.1)
    before = _on_one_device._cache_size()
    ensemble.run(scenes.three_body(m=(1.0, 2.0, 3.0)), y0s[:3], 0.2, rtol=1e-8, t0=0.1)
    assert _on_one_device._cache_size() == before


def return_of(scene, y0s, t1, **kwargs):
    watch = watches.CloseReturn.of(scene, **kwargs)
    return ensemble.run(scene, y0s, t1, rtol=RTOL, watch=watch).seen.best


@pytest.mark.usefixtures("device")
def test_an_ellipse_returns_after_its_period():
    scene = kepler(0.3)
    y0s = np.array([scene.starting(kepler(0.3, angle).y0).y0 for angle in (0.0, 1.0)])
    for sign in (1.0, -1.0):
        best = return_of(scene, y0s, sign * 7.0)
        # The cubic is right to h^4/384 of a fourth derivative, at steps of 0.3.
        np.testing.assert_allclose(best.after, 2 * np.pi, atol=1e-4)
        assert (best.distance < 1e-3).all()
    second = return_of(scene, y0s, 13.0, later=7.0)
    np.testing.assert_allclose(second.after, 4 * np.pi, atol=1e-4)
    first = return_of(scene, y0s, 20.0, close=1e-2)
    np.testing.assert_allclose(first.after, 2 * np.pi, atol=1e-4)
    none = return_of(scene, y0s, 0.5)
    assert (none.distance == np.inf).all()
    assert np.isnan(none.after).all()


@pytest.mark.slow
def test_the_closest_return_is_the_least_of_many_samples():
    scene, y0s = near_eight(4)
    best = return_of(scene, y0s, 14.0, later=1.0)
    for y0, distance, after in zip(y0s, best.distance, best.after, strict=True):
        ts = np.linspace(1.0, 14.0, 13001)
        ys = solve(scene.starting(y0), 14.0, ts=ts, rtol=RTOL).ys
        distances = np.linalg.norm(np.asarray(ys) - y0, axis=1)
        inside = 1 + np.argmin(distances[1:-1])
        assert abs(after - ts[inside]) < 2e-3
        assert abs(distance - distances[inside]) < 3e-3  # speed 1.5 times a spacing of samples


@pytest.mark.slow
def test_the_gap_may_leave_entries_out_and_wraps_angles():
    scene = scenes.pendulum()
    turning = scene.starting([0.0, 20.0])
    weight = jnp.array([1.0, 0.0])
    best = return_of(turning, turning.y0[None], 1.0, gap=watches.Gap(scene.system, weight))
    full = solve(turning, best.after[0], rtol=RTOL).y1
    # The same place after whole turns; which of them is nearest is decided by rounding.
    turns = float(full[0]) / (2 * np.pi)
    assert round(turns) >= 1
    assert turns == pytest.approx(round(turns), abs=1e-4)
    assert best.distance[0] < 1e-4


class Fallen(eqx.Module):
    depth: jax.Array

    def __call__(self, t, y):
        return y[1] < -self.depth


def test_a_watch_stops_a_motion_where_its_condition_holds():
    scene = scenes.cannonball()
    y0s = np.tile(scene.y0, (3, 1))
    y0s[1, 1] = -50.0
    y0s[2] = [0.0, 0.0, 0.0, 1e3]
    until = watches.Until(Fallen(jnp.asarray(30.0)))
    out = ensemble.run(scene, y0s, 1.0, watch=watches.Together(until, until))
    np.testing.assert_array_equal(out.seen[0], [False, True, False])
    np.testing.assert_array_equal(out.seen[1], out.seen[0])
    assert out.ok.all()
    assert 0 < out.t[1] < 1.0
    assert out.t[0] == out.t[2] == 1.0
    there = solve(scene.starting(y0s[1]), out.t[1]).y1
    assert gap(out.y1[1], there) < 1e-8  # other steps, of the default tolerance 1e-10
    back = ensemble.run(scene, y0s[:1], -9.0, watch=until)
    assert -9.0 < back.t[0] < 0.0


def test_batches_come_in_their_order_and_only_as_they_are_wanted():
    scene, y0s = near_eight(30)
    made = []

    def batches():
        for i in range(30):
            made.append(i)
            yield y0s[i : i + 1]

    parts = ensemble.stream(scene, batches(), 0.3, rtol=RTOL)
    first = next(parts)
    assert len(made) < 30
    rest = list(parts)
    whole = ensemble.run(scene, y0s, 0.3, rtol=RTOL)
    np.testing.assert_array_equal(np.concatenate([p.y1 for p in [first, *rest]]), whole.y1)
    next(ensemble.stream(scene, batches(), 0.3, rtol=RTOL))  # left early: nothing hangs


def test_a_bar_shows_the_progress(capsys):
    scene, y0s = near_eight(3)
    ensemble.run(scene, y0s, 0.1, progress=True)
    assert "motions" in capsys.readouterr().out
    ensemble.run(scene, y0s, 0.1)
    assert not capsys.readouterr().out


COMPARE = """
import jaxdyn
import sys
jaxdyn.configure()
import jax, numpy as np
if len(sys.argv) > 1:
    jax.distributed.initialize(sys.argv[1], 2, int(sys.argv[2]))
from jaxdyn import ensemble, scenes
scene = scenes.three_body()
y0s = np.asarray(scene.y0) + 0.01 * np.random.default_rng(3).standard_normal((41, 12))
alone = ensemble.run(scene, y0s, 3.0, rtol=1e-12)
spread = ensemble.run(scene, y0s, 3.0, rtol=1e-12, devices=jax.devices(), chunk=16)
assert (alone.steps == spread.steps).all()
print(len(jax.devices()), np.abs(alone.y1 - spread.y1).max())
"""


@pytest.mark.slow
def test_two_devices_give_the_numbers_of_one():
    printed = run_python(COMPARE, XLA_FLAGS="--xla_force_host_platform_device_count=2")
    devices, difference = printed.split()
    assert devices == "2"
    assert float(difference) < SOLVED


@pytest.mark.slow
def test_two_processes_give_the_numbers_of_one(tmp_path, unused_port):
    script = tmp_path / "compare.py"
    script.write_text(COMPARE)
    env = {"PATH": "/usr/bin:/bin", "PYTHONPATH": ":".join(sys.path), "HOME": str(tmp_path)}
    runs = [
        subprocess.Popen(
            [sys.executable, script, f"localhost:{unused_port}", str(i)],
            env=env,
            stdout=subprocess.PIPE,
            text=True,
        )
        for i in range(2)
    ]
    for run in runs:
        devices, difference = run.communicate(timeout=120)[0].split()[-2:]
        assert devices == "2"
        assert float(difference) < SOLVED


@pytest.fixture
def unused_port():
    import socket

    with socket.socket() as s:
        s.bind(("localhost", 0))
        return s.getsockname()[1]


@pytest.mark.slow
def test_a_million_motions_take_no_more_memory_than_a_few():
    scene = scenes.cannonball()
    start, size = np.asarray(scene.y0), 4096

    def total(batches):
        starts = (start * np.linspace(0.5, 1.5, size)[:, None] for _ in range(batches))
        return sum(int(part.ok.sum()) for part in ensemble.stream(scene, starts, 0.5, rtol=1e-6))

    total(8)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # [KiB]
    assert total(245) == 245 * size > 1_000_000
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 20_000


class Counting(Watch):
    count: object

    def towards(self, direction):
        return self

    def start(self, t0, y0):
        return t0

    def see(self, keep, t0, y0, t1, y1, memory):
        return memory, keep


class Position(eqx.Module):
    def __call__(self, t, y):
        return y[0]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"y0s": np.zeros(12)}, r"y0s: expected shape \(n, 12\), got shape \(12,\)"),
        ({"y0s": np.zeros((0, 12))}, r"y0s: expected shape \(n, 12\), got shape \(0, 12\)"),
        ({"y0s": None}, "y0s: expected shape"),
        ({"t1": np.zeros(3)}, r"t1: expected shape \(\) or \(2,\), got shape \(3,\)"),
        ({"t0": np.zeros((2, 1))}, r"t0: expected shape \(\) or \(2,\)"),
        ({"params": scenes.cannonball}, "params: expected a scene with the same system"),
        ({"watch": "escape"}, "watch: expected a Watch, got 'escape'"),
        ({"watch": Counting(len)}, "watch: expected modules with numbers, got <built-in"),
        (
            {"watch": watches.Until(Reaches(0, 1.0))},
            "condition: expected a module with __call__.*, got Reaches",
        ),
        (
            {"watch": watches.Until(Position())},
            r"condition: expected one True or False, got float64 of shape \(\)",
        ),
        ({"y0s": "north"}, "y0s: expected numbers, got 'north'"),
        ({"t1": "late"}, "t1: expected numbers, got 'late'"),
        ({"chunk": 0}, "chunk: expected a whole number, at least 1, got 0"),
        ({"chunk": 1.5}, r"chunk: expected a whole number, at least 1, got 1\.5"),
        ({"threads": 0}, "threads: expected a whole number, at least 1, got 0"),
        ({"devices": []}, "devices: expected at least one, got none"),
        ({"devices": 2}, "devices: expected a list of devices, got 2"),
        ({"devices": "cpu"}, "devices: expected a list of devices, got 'c"),
        ({"rtol": 2.0}, "rtol: expected between"),
        ({"max_steps": 0}, "max_steps: expected a whole number, at least 1"),
        ({"solver": RADAU9}, "solver: expected .* side by side, got Radau 9. .* jax.vmap"),
    ],
)
def test_misuse_is_refused(given, message):
    scene, y0s = near_eight(2)
    with pytest.raises(ValueError, match=message):
        ensemble.run(scene, **{"y0s": y0s, "t1": 1.0} | given)


def test_numbers_of_the_wrong_shape_are_named():
    scene, y0s = near_eight(2)
    params = eqx.tree_at(lambda s: s.effects[0].G, scene, jnp.ones(3))
    with pytest.raises(ValueError, match=r"params.effects\[0\].G: expected shape \(\) or \(2,\)"):
        ensemble.run(scene, y0s, params=params)


@pytest.mark.slow
def test_long_motions_keep_their_energy_to_rounding():
    scene = ode(lambda t, y: [y[1], -y[0]], [1.0, 0.0], 1.0)
    starts = np.random.default_rng(0).uniform(0.5, 2.0, (4, 2))
    ends = ensemble.run(scene, starts, 5e3, rtol=1e-16, solver=VERNER9)
    assert ends.steps.min() > 50_000
    energies = [np.sum(np.asarray(y) ** 2, axis=1) for y in (starts, ends.y1)]
    # 3e-14 without the correction of rounded coefficients.
    assert np.abs(energies[1] / energies[0] - 1).max() < 1e-14


def sign_force() -> Scene:
    return ode(lambda t, y: jnp.stack([y[1], -jnp.sign(y[0])]), [1.0, 0.0], t1=5.0)


@pytest.mark.slow
@pytest.mark.usefixtures("device")
def test_a_rate_with_conditions():
    scene = sign_force()
    y0s = np.array([[1.0, 0.0], [0.5, 0.0], [-2.0, 0.3]])
    out = ensemble.run(scene, y0s, rtol=RTOL, chunk=64)
    alone = [solve(scene.starting(y), 5.0, rtol=RTOL).y1 for y in y0s]
    assert gap(out.y1, np.array(alone)) < SOLVED


@pytest.mark.slow
def test_a_failed_motion_is_not_integrated_again_while_others_switch():
    # With as many steps as it is allowed it would never end.
    scene = sign_force()
    starts = jnp.array([[1.0, 0.0], [jnp.nan, 0.0]])
    steps = 10**9
    out = jax.vmap(lambda y: solve(scene.starting(y), 5.0, rtol=RTOL, max_steps=steps))(starts)
    np.testing.assert_array_equal(out.status, [Status.OK, Status.NOT_FINITE])


def test_traced_numbers_are_refused_by_name():
    def end(k):
        own = jax.vmap(lambda k: scenes.oscillator(k=k))(k)
        return ensemble.run(scenes.oscillator(), params=own).y1.sum()

    for transformed in (jax.grad(end), jax.jit(end)):
        with pytest.raises(ValueError, match=r"ensemble: expected numbers, got .* take jax\.vmap"):
            transformed(jnp.array([1.0, 2.0]))
