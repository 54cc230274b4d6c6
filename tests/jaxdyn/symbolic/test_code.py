"""Rates as source code in other languages, against the rates themselves."""

import ctypes
import json
import shutil
import subprocess

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import ZOO as QUICK
from helpers import refusal

import jaxdyn
from jaxdyn import Effect, scenes
from jaxdyn.analysis import energy
from jaxdyn.scenes import catalogue
from jaxdyn.symbolic.code import LANGUAGES, code
from jaxdyn.symbolic.parameters import parameters, with_parameters

#: Tolerance relative to the size of a rate: the same arithmetic in another order.
ROUNDING = 1e-13
STATES = 5
ZOO = catalogue.entries()


def _cases(scene):
    """(times, states, parameters) of random ones near those of a scene."""
    rng = np.random.default_rng(0)
    y0, p0 = np.asarray(scene.y0), parameters(scene).values
    ts = rng.uniform(0.1, 1.0, STATES)
    ys = y0 + 0.03 * (1.0 + abs(y0)) * rng.standard_normal((STATES, len(y0)))
    return ts, ys, p0 * rng.uniform(0.9, 1.1, (STATES, len(p0)))


sampled = pytest.mark.sample(*QUICK, "cylinder_on_ramp", "power_law", "two_masses")


@pytest.fixture(scope="module", params=ZOO)
def case(request):
    """A ready-made scene with times, states, parameters and the rates there."""
    scene = ZOO[request.param].make()
    ts, ys, ps = _cases(scene)

    @jax.jit
    def rate(t, y, p):
        return with_parameters(scene, p).rate(t, y)

    rates = np.array([rate(*at) for at in zip(ts, ys, ps, strict=True)])
    assert np.isfinite(rates).all()
    return scene, ts, ys, ps, rates


def _check(found, rates):
    assert np.shape(found) == rates.shape
    sizes = np.abs(rates).max(axis=1, keepdims=True)
    assert (np.abs(found - rates) <= ROUNDING * sizes).all()


def _loaded(source):
    made = {}
    exec(source, made)
    return made["rate"]


@sampled
def test_python(case):
    scene, ts, ys, ps, rates = case
    rate = _loaded(code(scene, "python"))
    _check(np.array([rate(*at) for at in zip(ts, ys.tolist(), ps.tolist(), strict=True)]), rates)


@sampled
def test_numpy_for_many_states_at_once(case):
    scene, ts, ys, ps, rates = case
    _check(_loaded(code(scene, "numpy"))(ts, ys.T, ps.T).T, rates)


@sampled
@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_javascript(case):
    scene, ts, ys, ps, rates = case
    cases = json.dumps([[t, list(y), list(p)] for t, y, p in zip(ts, ys, ps, strict=True)])
    program = (
        f"{code(scene, 'javascript')}console.log(JSON.stringify({cases}.map(c => rate(...c))))"
    )
    done = subprocess.run(["node", "-"], input=program, capture_output=True, text=True, check=True)
    _check(np.array(json.loads(done.stdout)), rates)


@sampled
@pytest.mark.skipif(shutil.which("cc") is None, reason="a compiler for C is not installed")
def test_c(case, tmp_path):
    scene, ts, ys, ps, rates = case
    path = tmp_path / "rate.so"
    _compiled(code(scene, "c"), path)
    function, found = ctypes.CDLL(str(path)).rate, np.empty_like(rates)
    for t, y, p, row in zip(ts, ys, ps, found, strict=True):
        arrays = (x.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for x in (y, p, row))
        function(ctypes.c_double(t), *arrays)
    _check(found, rates)


def _compiled(source, path):
    (path.parent / "rate.c").write_text(source)
    flags = ["-std=c99", "-Wall", "-Werror", "-Wno-unused-variable", "-shared", "-fPIC", "-lm"]
    subprocess.run(["cc", *flags, str(path.parent / "rate.c"), "-o", str(path)], check=True)


@pytest.mark.skipif(shutil.which("cc") is None, reason="a compiler for C is not installed")
def test_what_is_not_a_number_stays_so_in_c(tmp_path):
    """fmax(NaN, 0) is 0: a rate outside of its domain would be a number that looks right."""

    def rate(t, y):
        root = jnp.sqrt(y[0])
        return [jnp.maximum(root, 0.0), jnp.minimum(y[1], root), jnp.sign(root)]

    scene = jaxdyn.ode(rate, [1.0, 0.5, 0.0])
    _compiled(code(scene, "c"), tmp_path / "rate.so")
    function = ctypes.CDLL(str(tmp_path / "rate.so")).rate
    for y in (np.array([-1.0, 0.5, 0.0]), np.array([0.04, 0.5, 0.0]), np.zeros(3)):
        found = np.empty(3)
        arrays = (x.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for x in (y, y, found))
        function(ctypes.c_double(0.0), *arrays)
        np.testing.assert_allclose(found, scene.rate(0.0, jnp.asarray(y)), rtol=1e-15)


@sampled
@pytest.mark.skipif(shutil.which("julia") is None, reason="julia is not installed")
def test_julia(case):
    scene, ts, ys, ps, rates = case
    calls = "\n".join(
        f"println(rate({t!r}, {y.tolist()}, {p.tolist()}))"
        for t, y, p in zip(ts.tolist(), ys, ps, strict=True)
    )
    program = f"{code(scene, 'julia')}{calls}"
    done = subprocess.run(["julia", "-e", program], capture_output=True, text=True, check=True)
    _check(np.array([json.loads(line) for line in done.stdout.splitlines()]), rates)


def test_every_operation_in_every_language_that_has_it():
    def rate(t, y):
        a, b = y
        chosen = jnp.where((a < b) & ~(a > 2.0) | jnp.isfinite(b / a), jnp.abs(a), jnp.sign(b))
        rest = (
            jnp.maximum(a, t)
            + jnp.minimum(b, 0.5)
            + jnp.floor(3 * a)
            + jnp.ceil(b)
            + jax.lax.rem(b, a)
        )
        powers = jnp.cbrt(a) + jnp.exp2(b) + (a * a + b) ** -1.5 + a**b + jnp.sqrt(a) + a**-3
        arcs = jnp.arctan2(b, a) + jnp.arcsin(b / 4) + jnp.arccos(a / 4) + jnp.arctan(a)
        exponentials = jnp.sinh(a) + jnp.cosh(b) + jnp.tanh(a) + jnp.exp(b) + jnp.log(a)
        small = jnp.expm1(a) + jnp.log1p(b) + jax.nn.sigmoid(a) + jnp.tan(b)
        inverse = jnp.arcsinh(a) + jnp.arccosh(1 + b) + jnp.arctanh(a / 4)
        return [chosen + rest + powers, arcs + exponentials + small + inverse]

    scene = jaxdyn.ode(rate, [0.7, 1.3])
    wanted = np.asarray(scene.rate(jnp.asarray(0.3), scene.y0))
    y = scene.y0.tolist()
    assert np.allclose(_loaded(code(scene, "python"))(0.3, y, []), wanted, rtol=1e-14)
    assert np.allclose(_loaded(code(scene, "numpy"))(0.3, y, []), wanted, rtol=1e-14)
    if shutil.which("node"):
        program = f"{code(scene, 'javascript')}console.log(JSON.stringify(rate(0.3, {y}, [])))"
        done = subprocess.run(["node", "-e", program], capture_output=True, text=True, check=True)
        assert np.allclose(json.loads(done.stdout), wanted, rtol=1e-14)


def test_other_functions_of_a_scene_than_its_rate():
    scene = scenes.double_pendulum()
    total = _loaded(code(scene, "python", of=energy.energy, name="rate"))
    p = parameters(scene).values.tolist()
    y = (scene.y0 + 0.3).tolist()
    wanted = float(energy.energy(scene, jnp.zeros(()), jnp.asarray(y)))
    assert total(0.0, y, p) == [pytest.approx(wanted, rel=1e-14)]


#: A table with a jump, a ramp as steep as 1e9, and a wide piece; a road that begins as it ends.
KNOTS = np.array([-1.0, 0.5, 0.75, 0.75, 3.0, 3.0 + 1e-9, 1e6])
HEIGHTS = np.array([1.0, 2.0, 0.0, 5.0, 4.0, 5.0, -7.0])
ROAD = np.array([0.0, 1.0, 2.5, 4.0]), np.array([0.3, -1.0, 2.0, 0.3])
LONG = np.linspace(-2.0, 5.0, 300), np.sin(np.arange(300.0))


def _table(**ends):
    return jaxdyn.ode(lambda t, y: [jnp.interp(y[0], KNOTS, HEIGHTS, **ends)], [0.3])


def _given(t, y, p):
    return [jnp.interp(2.0 * y[0] - t, p["knots"], p["heights"], right=p["right"])]


def _slope(t, y):
    return [jax.grad(lambda x: jnp.interp(x, KNOTS, HEIGHTS))(y[0])]


def _with_slope(t, y):
    value, slope = jax.jvp(lambda x: jnp.interp(x, KNOTS, HEIGHTS), (y[0],), (jnp.ones(()),))
    return [value + 2.0 * slope]


def _held(t, y):
    """The height at the last knot, for several numbers, and a ramp from there on."""
    knots, heights = jnp.asarray(KNOTS), jnp.asarray(HEIGHTS)
    last = jnp.searchsorted(knots, y, side="right") - 1
    here = jnp.clip(last, 0, len(knots) - 2)
    return jnp.where(last < 0, 7.0, heights[last]) + (y - knots[here]) * heights[here + 1]


def _held_twice(t, y):
    """As a table of parameters, of 300 knots, and of another one."""
    first, second = (jnp.searchsorted(knots, y[0]) for knots in (LONG[0], ROAD[0]))
    return [
        jnp.append(LONG[1], 2.0)[first] * jnp.append(ROAD[1], -1.0)[second] + first.astype(float)
    ]


def _select(t, y):
    """The first of several conditions; none may hold, and several may."""
    beyond = [y < 0.5, (y < 0.75) ^ (y > 2.0), y[::-1] != 0.75]
    return jnp.select(beyond, [y, jnp.full(2, 2.0), -y[::-1]], 3 * y)


TABLES = {
    "plain": _table(),
    "ends": _table(left=-3.0, right=9.0),
    "extrapolated": _table(left="extrapolate", right="extrapolate"),
    "with its slope": jaxdyn.ode(_with_slope, [0.3]),
    "period": jaxdyn.ode(lambda t, y: [jnp.interp(y[0], *ROAD, period=4.5)], [0.3]),
    "remainder": jaxdyn.ode(lambda t, y: [jnp.interp(y[0] % 4.0, *ROAD)], [0.3]),
    "parameters": jaxdyn.ode(
        _given, [0.3], params={"knots": KNOTS, "heights": HEIGHTS, "right": 2.0}
    ),
    "long": jaxdyn.ode(lambda t, y: [jnp.interp(y[0], *LONG)], [0.3]),
    "slope": jaxdyn.ode(_slope, [0.3]),
    "array": jaxdyn.ode(lambda t, y: jnp.interp(y, KNOTS, HEIGHTS), [0.3, 0.4]),
    "select": jaxdyn.ode(_select, [0.3, 0.4]),
    "held": jaxdyn.ode(_held, [0.3, 0.4]),
    "two held": jaxdyn.ode(_held_twice, [0.3]),
}


@pytest.mark.parametrize("name", TABLES)
def test_a_table_is_a_choice_among_its_pieces(name, tmp_path):
    scene, rng = TABLES[name], np.random.default_rng(0)
    knots = {"period": ROAD[0], "remainder": ROAD[0], "long": LONG[0]}.get(name, KNOTS)
    beside = [np.nextafter(knots, side) for side in (-np.inf, np.inf)]
    random = rng.uniform(-3.0, 6.0, 200), rng.uniform(3.0, 3.0 + 1e-9, 9), rng.uniform(-2e6, 2e6, 9)
    xs = np.concatenate([knots, *beside, *random])
    ys = np.stack([xs, xs[::-1]][: len(scene.y0)], axis=1)
    p = parameters(scene).values
    wanted = np.asarray(jax.vmap(lambda y: scene.rate(jnp.zeros(()), y))(ys))
    rate = _loaded(code(scene, "python"))
    found = {"python": [rate(0.0, y, p.tolist()) for y in ys.tolist()]}
    found["numpy"] = np.transpose(_loaded(code(scene, "numpy"))(0.0, ys.T, p))
    if shutil.which("node"):
        program = f"const p = {p.tolist()}, ys = {ys.tolist()};{code(scene, 'javascript')}"
        program += "console.log(JSON.stringify(ys.map(y => rate(0, y, p))))"
        done = subprocess.run(["node", "-"], input=program, capture_output=True, text=True)
        found["javascript"] = json.loads(done.stdout)
    if shutil.which("cc"):
        _compiled(code(scene, "c"), tmp_path / "rate.so")
        function, rows = ctypes.CDLL(str(tmp_path / "rate.so")).rate, np.empty_like(wanted)
        for y, row in zip(ys, rows, strict=True):
            arrays = (x.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for x in (y, p, row))
            function(ctypes.c_double(0.0), *arrays)
        found["c"] = rows
    for each in found.values():
        np.testing.assert_allclose(each, wanted, rtol=4e-15, atol=4e-15)


def test_numbers_are_inputs():
    one = code(scenes.cannonball(m=3.0), "c")
    assert one == code(scenes.cannonball(m=5.0), "c")


class Winding(Effect):
    """A force found by a loop of unknown length."""

    def force(self, t, r, v, m):
        return jax.lax.while_loop(lambda x: jnp.sum(x * x) > 1.0, lambda x: 0.5 * x, r)


def test_what_cannot_be_written_is_refused():
    loop = scenes.cannonball() + Winding()
    assert "code: expected a rate with formulas, got" in refusal(lambda: code(loop, "c"))
    knots, heights = jnp.arange(3.0), jnp.ones((3, 3)).at[1, 1].set(2.0)

    def entry(t, y):
        return [heights[jnp.searchsorted(knots, t), jnp.searchsorted(knots, y[0])]]

    search = jaxdyn.ode(entry, [0.0])
    assert "of several places in tables" in refusal(lambda: code(search, "c"))
    heights = heights[0]
    around = jaxdyn.ode(
        lambda t, y, p: [jnp.interp(t, knots, heights, period=p["L"])], [0.0], params={"L": 4.0}
    )
    assert "formulas, got jnp.interp with a period, in" in refusal(lambda: code(around, "c"))
    said = refusal(lambda: code(scenes.pendulum(), "fortran"))
    assert "language: expected one of c, javascript, julia, numpy, python" in said
    assert "a name of a function" in refusal(lambda: code(scenes.pendulum(), "c", name="1 x"))
    bell = jaxdyn.ode(lambda t, y: [jax.scipy.special.erf(y[0])], [1.0])
    said = refusal(lambda: code(bell, "javascript"))
    assert said.endswith("with the function erf, got javascript. Take another language: python, c.")
    assert "math.erf(y[0])" in code(bell, "python")
    scene = scenes.pendulum()
    traced = refusal(lambda: jax.jit(lambda g: parameters(scenes.pendulum(g=g)).values)(9.0))
    assert "one whose numbers are known" in traced
    assert "values" in refusal(lambda: with_parameters(scene, jnp.zeros(2)))


def test_names_are_the_shortest_that_tell_parameters_apart():
    named = parameters(scenes.two_springs()).names
    assert named[:3] == ("m[0]", "effects[0].k", "effects[0].length")
    assert "g" in named
    assert parameters(scenes.top()).names[:2] == ("r[0,0]", "r[0,1]")
    own = jaxdyn.ode(lambda t, y, p: [p["a"][1] * y[0]], [1.0], params={"a": [1.0, 2.0]})
    assert parameters(own).names == ("a[0]", "a[1]")
    assert len(LANGUAGES) == 5
