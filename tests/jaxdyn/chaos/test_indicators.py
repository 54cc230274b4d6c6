"""MEGNO, SALI and GALI against an independent integration, their limits, and maps of them."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import gap, refusal
from PIL import Image
from scipy.integrate import solve_ivp

import jaxdyn
from jaxdyn import Status, chaos, drawing, scenes
from jaxdyn.scales import sizes_at_start

REGULAR, CHAOTIC = 0.1, -0.2  # y of starts at x = 0 with velocity along x, at energy 1/8


def henon_heiles(t, y):
    del t
    x, y, u, v = y
    return [u, v, -x - 2 * x * y, -y - x**2 + y**2]


def crossing(y, v):
    """At x = 0 and energy 1/8; NaN where there is none."""
    speed = jnp.sqrt(2 / 8 - y**2 + 2 * y**3 / 3 - v**2)
    return jaxdyn.ode(henon_heiles, jnp.stack([0.0 * y, y, speed, v]))


STARTS = np.array([crossing(y, 0.0).y0 for y in (REGULAR, CHAOTIC)])


def _by_scipy(start: np.ndarray, tangents: np.ndarray, sizes: np.ndarray, t1: float) -> tuple:
    """Y, its mean, and the tangents at the end in sizes, whose lengths are left to grow."""
    m = len(tangents)

    def rate(t, s):
        x, y, u, v = s[:4]
        columns = s[4 : 4 + 4 * m].reshape(m, 4)
        jac = np.array(
            [[0, 0, 1, 0], [0, 0, 0, 1], [-1 - 2 * y, -2 * x, 0, 0], [-2 * x, 2 * y - 1, 0, 0]]
        )
        rates = columns @ (jac * sizes / sizes[:, None]).T
        growth = columns[0] @ rates[0] / (columns[0] @ columns[0])
        field = [u, v, -x - 2 * x * y, -y - x**2 + y**2]
        return [*field, *rates.ravel(), 2 * t * growth, s[-2] / t if t else 0.0]

    s0 = [*start, *tangents.ravel(), 0.0, 0.0]
    run = solve_ivp(rate, (0, t1), s0, rtol=1e-12, atol=1e-13, method="DOP853")
    end = run.y[:, -1]
    return end[-2] / t1, end[-1] / t1, end[4 : 4 + 4 * m].reshape(m, 4)


def _tangents(m: int) -> np.ndarray:
    """Those that the indicators begin with, in sizes."""
    u = np.random.default_rng(0).normal(size=(m, 4))
    return u / np.linalg.norm(u, axis=1, keepdims=True)


@pytest.mark.parametrize(("i", "t1", "tolerance"), [(0, 200.0, 1e-8), (1, 60.0, 1e-7)])
def test_megno_is_that_of_an_independent_integration(i, t1, tolerance):
    scene = crossing(REGULAR, 0.0)
    found = chaos.megno(scene, STARTS[i], t1, rtol=1e-12)
    sizes = sizes_at_start(scene.starting(STARTS[i]), 0.0, t1)
    value, mean, _ = _by_scipy(STARTS[i], _tangents(1), sizes, t1)
    assert gap(found.megno, value) < tolerance
    assert gap(found.mean, mean) < tolerance
    assert found.time == t1


def test_megno_tells_regular_from_chaotic_motions():
    found = chaos.megno(crossing(REGULAR, 0.0), STARTS[None], 1000.0)
    assert found.mean.shape == (1, 2)
    assert abs(found.mean[0, 0] - 2) < 0.1
    assert found.mean[0, 1] > 20
    assert "1/s" not in repr(found)  # the unit of time of the scene is not known there
    # The mean grows like half the Lyapunov exponent times the time.
    assert 0.5 < found.mean[0, 1] / (0.5 * 1000.0 * found.exponent[0, 1]) < 2


@pytest.mark.slow
def test_sali_and_gali_are_those_of_an_independent_integration():
    sizes = sizes_at_start(crossing(REGULAR, 0.0), 0.0, 50.0)
    _, _, tangents = _by_scipy(STARTS[0], _tangents(2), sizes, 50.0)
    u = tangents / np.linalg.norm(tangents, axis=1, keepdims=True)
    sali = chaos.sali(crossing(REGULAR, 0.0), STARTS, 50.0, rtol=1e-12)
    assert gap(sali.index[0], min(np.linalg.norm(u[0] + u[1]), np.linalg.norm(u[0] - u[1]))) < 1e-9
    gali = chaos.gali(crossing(REGULAR, 0.0), STARTS, 50.0, count=2, rtol=1e-12)
    assert gap(gali.index[0], np.sqrt(1 - (u[0] @ u[1]) ** 2)) < 1e-9


def test_tangents_of_a_chaotic_motion_align_and_end_the_run():
    early = chaos.sali(crossing(REGULAR, 0.0), STARTS, 100.0)
    found = chaos.sali(crossing(REGULAR, 0.0), STARTS, 1000.0)
    # On a torus it stays of one order, where a power of time would fall a hundredfold.
    assert 0.3 < found.index[0] / early.index[0] < 10
    assert found.time[0] == 1000.0
    # They are aligned to 1e-14 in the sizes of the scene's own start, a few times that in these.
    assert found.index[1] < 1e-13
    assert found.time[1] < 600.0


def test_a_map_has_every_value_and_a_picture(tmp_path):
    y, v = np.linspace(-0.5, 0.5, 6), np.linspace(-0.2, 0.6, 5)
    found = chaos.chaos_map(crossing, y, v, 300.0)
    assert found.mean.shape == (6, 5)
    outside = np.isnan(found.mean)
    speed = 2 / 8 - y[:, None] ** 2 + 2 * y[:, None] ** 3 / 3 - v[None] ** 2
    assert (outside == (speed < 0)).all()
    assert (found.status[outside] == Status.NOT_FINITE).all()
    one = chaos.megno(crossing(REGULAR, 0.0), crossing(y[3], v[1]).y0, 300.0)
    assert gap(found.mean[3, 1], one.mean) < 1e-12
    path = tmp_path / "map.png"
    drawing.chaos_map(found, path, names=("y", "vy"), title="Henon and Heiles")
    with Image.open(path) as picture:
        assert len(np.unique(np.asarray(picture.convert("RGB")).reshape(-1, 3), axis=0)) > 10


@pytest.mark.slow
def test_parameters_may_differ():
    def heated(rho, sigma):
        return scenes.lorenz(rho=rho, sigma=sigma)

    found = chaos.chaos_map(heated, [10.0, 28.0], [10.0], 200.0)
    assert found.exponent[0, 0] < -0.1  # a stable equilibrium
    assert abs(found.exponent[1, 0] - 0.9056) < 0.2


@pytest.mark.slow
def test_a_map_resumes_bit_for_bit(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxdyn.chaos.maps._CHUNK", 3)
    path = tmp_path / "map.jsonl"
    grid = np.linspace(-0.4, 0.6, 4), np.linspace(0.0, 0.9, 3)  # some starts do not exist
    whole = chaos.chaos_map(crossing, *grid, 50.0, path=path)
    text = path.read_bytes()
    path.write_bytes(b"".join(text.splitlines(keepends=True)[:3]))
    again = chaos.chaos_map(crossing, *grid, 50.0, path=path)
    assert path.read_bytes() == text
    for name in ("mean", "exponent", "time", "status"):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    assert np.isnan(whole.mean).any()
    assert whole.ok.any()
    plain = chaos.chaos_map(crossing, *grid, 50.0)
    np.testing.assert_allclose(plain.mean, whole.mean, rtol=1e-9)
    assert "of this call" in refusal(lambda: chaos.chaos_map(crossing, *grid, 60.0, path=path))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: chaos.megno(s, np.zeros((3, 2)), 1.0), "starts: expected shape (4,)"),
        (lambda s: chaos.gali(s, t1=1.0, count=5), "count: expected at most 4"),
        (lambda s: chaos.gali(s, t1=1.0, count=1), "count: expected a whole number, at least 2"),
        (lambda s: chaos.chaos_map(crossing, [], [0.1], 1.0), "grid: expected at least one"),
        (lambda s: chaos.chaos_map(crossing, [0.1], [3.0], 1.0), "make: expected at least one"),
    ],
)
def test_misuse_is_refused(call, message):
    assert refusal(lambda: call(crossing(REGULAR, 0.0))).startswith(message)


def test_a_rate_that_jumps_with_the_state_is_refused():
    """Without their jumps tangents grew at the rate 0.4 where friction stops the motion."""

    def stops(t, y):
        return [y[1], -y[0] - 0.3 * jnp.sign(y[1])]

    for call in (chaos.megno, chaos.sali, lambda *args: chaos.gali(*args, count=2)):
        said = refusal(lambda call=call: call(jaxdyn.ode(stops, [2.0, 0.1], 20.0)))
        assert "scene: expected a rate that does not jump with the state" in said
        assert "use jaxdyn.lyapunov_exponents" in said


@pytest.mark.slow
def test_a_rate_that_bends_or_switches_in_time_is_not():
    def bends(t, y):
        pull = jnp.where(t > 3.0, 1.0, 0.5)
        return [y[1], -y[0] - pull * jnp.maximum(y[0], 0.0)]

    found = chaos.megno(jaxdyn.ode(bends, [2.0, 0.1], 20.0))
    assert found.status == Status.OK
    assert abs(float(found.exponent)) < 0.2
