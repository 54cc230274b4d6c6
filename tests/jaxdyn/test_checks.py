"""Every host-side check: what is refused and what the message says."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdyn import _checks, ensemble, scenes, simulate, solve
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.events import Every


def test_fail_puts_the_message_together():
    error = _checks.fail("mass", "> 0", -1.0, "Masses are in kg.")
    assert isinstance(error, ValueError)
    assert str(error) == "mass: expected > 0, got -1.0. Masses are in kg."
    assert str(_checks.fail("mass", "> 0", -1.0)) == "mass: expected > 0, got -1.0."


def test_is_traced_tells_tracers_from_values():
    seen = []

    def note(x):
        seen.append((_checks.is_traced(x), _checks.is_traced({"a": 1.0, "b": x})))
        return x

    jax.jit(note)(1.0)
    jax.grad(note)(1.0)
    jax.vmap(note)(jnp.ones(2))
    assert seen == [(True, True)] * 3
    for value in (1, 1.0, np.ones(2), jnp.ones(2), None, [jnp.ones(2)]):
        assert not _checks.is_traced(value)


def test_float64_is_demanded():
    _checks.float64()
    with (
        jax.enable_x64(False),
        pytest.raises(ValueError, match=r"floats: expected 64-bit .* jaxdyn\.configure\(\)"),
    ):
        _checks.float64()


@pytest.mark.parametrize(
    ("x", "shape", "message"),
    [
        ("1", (), r"x: expected numbers, got '1'\. Help\."),
        (["1", 2.0], (2,), r"x: expected numbers, got \['1', 2\.0\]\. Help\."),
        (np.array(["1"]), (1,), r"x: expected numbers, got array\(.*\)\. Help\."),
        (True, (), r"x: expected numbers, got True\. Help\."),
        (np.array([True]), (1,), r"x: expected numbers, got array\(.*\)\. Help\."),
        ("abc", (), r"x: expected numbers, got 'abc'\. Help\."),
        (None, (), r"x: expected numbers, got None\. Help\."),
        ([[1.0], [1.0, 2.0]], (None,), r"x: expected numbers, got \[\[1\.0\], .*\. Help\."),
        ([1.0], (), r"x: expected shape \(\), got shape \(1,\)\. Help\."),
        ([1.0], (2,), r"x: expected shape \(2,\), got shape \(1,\)\. Help\."),
        (1.0, (None,), r"x: expected shape \(any,\), got shape \(\)\. Help\."),
        ([[1.0, 2.0]], (None, 3), r"x: expected shape \(any, 3\), got shape \(1, 2\)\. Help\."),
        ([1.0, np.nan], (2,), r"x: expected finite numbers, got nan at index \[1\]\. Help\."),
        (np.inf, (), r"x: expected finite numbers, got inf\. Help\."),
    ],
)
def test_array_refuses(x, shape, message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        _checks.array("x", x, shape, "Help.")


def test_array_returns_floats_and_lets_tracers_pass():
    got = _checks.array("x", [1, 2], (None,))
    assert got.dtype == jnp.float64
    assert jnp.isnan(jax.jit(lambda x: _checks.array("x", x, ()))(jnp.nan))


@pytest.mark.parametrize(
    ("x", "message"),
    [
        ([1.0, -2.0], r"m: expected > 0, got -2\.0\. Help\."),
        (0.0, r"m: expected > 0, got 0\.0\. Help\."),
        ([1.0, np.nan], r"m: expected finite numbers, got nan at index \[1\]\. Help\."),
    ],
)
def test_positive_refuses(x, message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        _checks.positive("m", x, "Help.")


def test_positive_lets_good_numbers_and_tracers_pass():
    np.testing.assert_array_equal(_checks.positive("m", [1, 2]), [1.0, 2.0])
    assert jax.jit(lambda x: _checks.positive("m", x))(-1.0) == -1.0


def test_a_function_must_take_its_arguments_by_position():
    _checks.check_callable("make", lambda x, y=1.0: x, "parameter")
    _checks.check_callable("make", max, "parameter")  # has no signature
    for function in (lambda *, x: x, lambda x, y: x, lambda: 0, 3.0):
        with pytest.raises(ValueError, match=r"make: expected a function of \(parameter\), got"):
            _checks.check_callable("make", function, "parameter")


def test_choice_suggests_the_nearest():
    assert _checks.choice("label", "x", ["y", "x"]) == "x"
    message = r"^label: expected one of apple, pear, got 'appel'\. Did you mean 'apple'\?$"
    with pytest.raises(ValueError, match=message):
        _checks.choice("label", "appel", ["pear", "apple"])
    with pytest.raises(ValueError, match=r"got 'zzz'\.$"):
        _checks.choice("label", "zzz", ["pear", "apple"])


TIMES = [
    np.timedelta64(2, "s"),
    np.timedelta64("NaT", "s"),
    np.datetime64("2020-01-01"),
    np.array([1, 2], "timedelta64[ms]"),
]


@pytest.mark.parametrize("x", TIMES, ids=repr)
def test_times_with_a_unit_are_refused(x):
    message = r"^t1: expected numbers, got .*, in units of NumPy\. .* x / np\.timedelta64\(1, 's'\)"
    scene = scenes.oscillator()
    for use in (
        lambda: _checks.numbers("t1", x),
        lambda: _checks.host_array("t1", x, ()),
        lambda: simulate(scene, x),
        lambda: scene.starting(scene.y0, x),
    ):
        with pytest.raises(ValueError, match=message):
            use()
    with pytest.raises(ValueError, match=r"^t1: expected numbers, got"):
        solve(scene, x)
    with pytest.raises(ValueError, match=r"^number: expected numbers, got"):
        Every(x)
    with pytest.raises(ValueError, match=r"^samples: expected numbers, got"):
        simulate(scene, 2.0, samples=np.array([0, 1], "timedelta64[s]"))


@pytest.mark.parametrize(
    "x", [1j, np.complex64(1.0), np.array(1.0 + 0j), jnp.asarray(2j)], ids=repr
)
def test_complex_numbers_are_refused(x):
    scene = scenes.oscillator()
    for use in (
        lambda: _checks.numbers("x", x),
        lambda: _checks.host_array("x", x, ()),
        lambda: _checks.array("x", [x, 0.0], (2,)),
        lambda: scene.starting([x, 0.0]),
        lambda: simulate(scene, x),
        lambda: solve(scene, x),
        lambda: Every(x),
    ):
        with pytest.raises(ValueError, match=r"^\w+: expected (real )?numbers, got"):
            use()


@pytest.mark.parametrize("kind", [np.float32, np.float16, jnp.bfloat16, np.int32])
def test_data_in_fewer_bits_are_converted_exactly(kind):
    data = np.array([1.1, 0.3]).astype(kind)
    exact = data.astype(float)
    for given in (data, jnp.asarray(data)):
        scene = scenes.oscillator().starting(given)
        assert scene.y0.dtype == float
        np.testing.assert_array_equal(scene.y0, exact)
        motion = simulate(scene, given[0], samples=3)
        assert motion.ys.dtype == motion.ts.dtype == float
        assert motion.ts[-1] == exact[0]
        np.testing.assert_array_equal(FreePoints(given).m, exact)


def test_a_number_too_large_for_a_float_is_refused():
    for use in (_checks.numbers, lambda name, x: _checks.host_array(name, x, ())):
        with pytest.raises(ValueError, match=r"^t1: expected numbers, got 1000.*\.\.\."):
            use("t1", 10**400)


def test_flags_are_true_or_false():
    assert _checks.flag("fixed", True) is True
    scene = scenes.oscillator()
    for use in (
        lambda: solve(scene, 1.0, fixed="no"),
        lambda: ensemble.run(scene, scene.y0[None], 1.0, fixed="no"),
    ):
        with pytest.raises(ValueError, match=r"^fixed: expected True or False, got 'no'"):
            use()
    with pytest.raises(ValueError, match=r"^adjoint: expected True, False or .steps., got 1"):
        solve(scene, 1.0, adjoint=1)


HUGE = 10**400


@pytest.mark.parametrize(
    ("use", "name"),
    [
        (lambda s: solve(s, HUGE), "t1"),
        (lambda s: solve(s, 1.0, rtol=HUGE), "number"),
        (lambda s: simulate(s, 1.0, max_steps=HUGE), "max_steps"),
        (lambda s: simulate(s, 1.0, samples=HUGE), "samples"),
        (lambda s: scenes.oscillator(k=HUGE), "number"),
        (lambda s: s.starting(s.y0, HUGE), "t1"),
    ],
)
def test_numbers_beyond_all_floats_are_refused(use, name):
    with pytest.raises(ValueError, match=rf"^{name}: expected .*, got 1000\d*\.\.\.\d*"):
        use(scenes.oscillator())


@pytest.mark.parametrize("given", ["a", ["a", 1.0], [None, 1.0], {"a": 1.0}, np.array(["a"])])
def test_numbers_that_are_none_are_refused_by_what_came(given):
    with pytest.raises(ValueError, match=r"^number: expected numbers, got "):
        _checks.as_float(given)
