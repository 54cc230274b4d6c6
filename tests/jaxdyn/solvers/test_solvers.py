"""One-step pairs: order conditions, convergence, and two ways of writing one step."""

import dataclasses
import itertools
import json
from importlib import resources
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from helpers import EXACT, gap, kepler, kepler_state
from references.order_conditions import DIGITS, OrderConditions, number

from jaxdyn import scenes, simulate, solvers
from jaxdyn.solvers import EULER, NYSTROM12, RK4, VERNER9, Method, from_diffrax

TSIT5 = from_diffrax(diffrax.Tsit5())
EXPORTED = [getattr(solvers, name) for name in solvers.__all__]
METHODS = [x for x in EXPORTED if isinstance(x, Method)]
PAIRS = pytest.mark.parametrize("pair", [NYSTROM12, VERNER9, TSIT5], ids=lambda p: p.name)


def _data(file: str) -> dict:
    return json.loads(resources.files("jaxdyn").joinpath("data", file).read_text())


def _forced(t, y):
    """Two oscillators, one of them forced: second order, dependent on time, free of v."""
    q, v = y[:2], y[2:]
    return jnp.concatenate([v, -q * q * q + jnp.stack([jnp.cos(2 * t), 0 * t])])


def test_verner9_has_order_9_and_an_estimate_of_order_8():
    table = _data("verner9_8.json")
    with mp.workdps(DIGITS):
        conditions = OrderConditions(table["a"])
        method = conditions.residuals(table["b"], VERNER9.order + 1)
        error = conditions.residuals(table["b_err"], VERNER9.error_order, of_error=True)
        # The table is printed to 40 digits.
        assert conditions.row_sums(table["c"]) < 1e-38
    assert max(method[:-1]) < 1e-38
    assert max(error[:-1]) < 1e-38
    assert min(method[-1], error[-1]) > 1e-7  # and no more than that


def _nystrom_step_of_kepler(table: dict, h: Any, e: Any) -> tuple:
    """Errors of q and v, and their estimates, after one step of r'' = -r/|r|^3, in mpmath."""

    def combine(row, k):
        return [mp.fsum(number(w) * x[d] for w, x in zip(row, k, strict=False)) for d in (0, 1)]

    q = [1 - e, mp.mpf(0)]
    v = [mp.mpf(0), mp.sqrt((1 + e) / (1 - e))]
    k = []
    for c, row in zip(table["c"], table["a"], strict=True):
        shift = combine(row, k)
        x = [q[d] + number(c) * h * v[d] + h * h * shift[d] for d in (0, 1)]
        k.append([-xi / mp.hypot(*x) ** 3 for xi in x])
    dq, dv, q_error, v_error = (combine(table[name], k) for name in ("b", "bp", "b_err", "bp_err"))
    anomaly = mp.findroot(lambda E: E - e * mp.sin(E) - h, h)
    rate = 1 / (1 - e * mp.cos(anomaly))
    b = mp.sqrt(1 - e * e)
    exact_q = [mp.cos(anomaly) - e, b * mp.sin(anomaly)]
    exact_v = [-mp.sin(anomaly) * rate, b * mp.cos(anomaly) * rate]
    return (
        mp.hypot(*(q[d] + h * v[d] + h * h * dq[d] - exact_q[d] for d in (0, 1))),
        mp.hypot(*(v[d] + h * dv[d] - exact_v[d] for d in (0, 1))),
        mp.hypot(*(h * h * x for x in q_error)),
        mp.hypot(*(h * x for x in v_error)),
    )


def test_nystrom12_converges_with_order_12_and_its_estimate_with_order_10():
    table = _data("rkn12_10_17.json")
    with mp.workdps(DIGITS):
        e = mp.mpf(3) / 10
        coarse = _nystrom_step_of_kepler(table, mp.mpf(1) / 50, e)
        fine = _nystrom_step_of_kepler(table, mp.mpf(1) / 100, e)
        slopes = [float(mp.log(a / b, 2)) for a, b in zip(coarse, fine, strict=True)]
    assert min(slopes[:2]) > 13 - 0.2  # one step of a method of order p is right to h^(p + 1)
    assert abs(min(slopes[2:]) - NYSTROM12.error_order) < 0.2


@PAIRS
def test_global_error_falls_with_the_order(pair):
    # Few and large steps: below 1e-14 rounding would show instead.
    counts, span, e = {12: (4, 8), 9: (6, 12), 5: (40, 80)}[pair.order], 2.0, 0.3
    field = kepler(e).rate

    @jax.jit
    def end(n):
        h = span / n
        step = lambda i, y: y + pair.in_loops(1).advance(field, i * h, h, y).increment  # noqa: E731
        return jax.lax.fori_loop(0, n, step, kepler(e).y0)

    errors = [gap(end(n), kepler_state(e, span)) for n in counts]
    assert np.log2(errors[0] / errors[1]) > pair.order - 0.2


@pytest.mark.sample("Verner 9(8)")
@PAIRS
def test_rolled_and_unrolled_steps_are_one_step(pair):
    y = jnp.array([0.3, -0.2, 0.5, 1.1])
    for h in (0.4, -0.4):
        code = pair.advance(_forced, 0.7, h, y)
        for loops in (1, 2, 3):
            loop = pair.in_loops(loops).advance(_forced, 0.7, h, y)
            assert gap(loop.increment, code.increment) < EXACT
            assert gap(loop.error, code.error) < EXACT
            assert gap(loop.rest, code.rest) < 1e-3 * EXACT
            assert abs(loop.speed - code.speed) < 1e-6 * abs(code.speed)  # of differences


@pytest.mark.sample("Verlet 2", "Euler", "Taylor 8", "Taylor 12")
@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)
def test_every_method_keeps_the_contract(method):
    assert method.order >= 1
    assert method.error_order >= 1
    assert method.stable > 0
    # Few loops are asked for where a program is to be small: the step is the same.
    y, (t, h) = jnp.array([0.3, -0.2, 0.5, 1.1]), jnp.array([0.7, 0.01])
    found = jax.jit(lambda t, h, y: method.advance(_forced, t, h, y))(t, h, y)
    for n in (1, 2):
        small = method.in_loops(n)
        assert small is method.in_loops(n)
        assert small.position_only == method.position_only
        if small is not method:
            looped = jax.jit(lambda t, h, y, m=small: m.advance(_forced, t, h, y))(t, h, y)
            assert gap(looped.increment, found.increment) < EXACT
    # Drag, v' = -v, is solved to the order of the method, or not at all.
    slowed = method.advance(lambda t, y: jnp.stack([y[1], -y[1]]), t, h, jnp.ones(2))
    right = gap(slowed.increment[1], np.expm1(-h)) < max(EXACT, 0.1 * h**method.order)
    assert right == (not method.position_only)


@PAIRS
def test_a_step_is_what_the_table_says(pair):
    y, t, h = np.array([0.3, -0.2, 0.5, 1.1]), 0.7, 0.4
    q, v = y[:2], y[2:]
    k = []
    for c, row in zip(pair.c, pair.a, strict=True):
        shift = sum((w * x for w, x in zip(row, k, strict=False)), np.zeros(4))
        if pair.position_only:
            at = np.concatenate([q + c * h * v + h * h * shift[2:], v])
        else:
            at = y + h * shift
        k.append(np.asarray(_forced(t + c * h, jnp.asarray(at))))
    sums = np.einsum("pws,sk->pwk", pair.weights, np.stack(k))
    if pair.position_only:
        (dq, dv), (q_error, v_error) = sums[..., 2:]
        wanted = np.concatenate([h * v + h * h * dq, h * dv])
        estimate = np.concatenate([h * h * q_error, h * v_error])
    else:
        wanted, estimate = h * sums[0, 0], h * sums[1, 0]
    increment, error = pair.advance(_forced, t, h, jnp.asarray(y))[:2]
    assert gap(increment, wanted) < EXACT
    assert gap(error, estimate) < EXACT


@PAIRS
def test_a_step_back_undoes_a_step(pair):
    y = jnp.array([0.3, -0.2, 0.5, 1.1])
    h = 0.1 if pair.order > 5 else 0.003
    there = y + pair.advance(_forced, 0.0, h, y).increment
    back = there + pair.advance(_forced, h, -h, there).increment
    assert gap(back, y) < EXACT


@PAIRS
def test_tables_are_explicit_and_consistent(pair):
    assert np.all(np.triu(pair.a) == 0)
    assert pair.stages == len(pair.c) == pair.a.shape[0] == pair.weights.shape[2]
    # Constant slope or acceleration: 1, or 1/2 for positions; the estimate sees no error.
    exact = [0.5, 1.0] if pair.position_only else [1.0]
    assert gap(pair.weights.sum(axis=2), [exact, [0.0] * len(exact)]) < EXACT
    shift = pair.c**2 / 2 if pair.position_only else pair.c
    assert gap(pair.a.sum(axis=1), shift) < 2 * EXACT


def test_pairs_are_told_apart_by_identity():
    pairs = [NYSTROM12, VERNER9, TSIT5, dataclasses.replace(TSIT5)]
    assert all(a != b for a, b in itertools.combinations(pairs, 2))
    assert len(set(pairs)) == 4


@pytest.mark.sample("euler")
@pytest.mark.parametrize(("method", "order"), [(EULER, 1), (RK4, 4)], ids=["euler", "rk4"])
def test_methods_without_an_error_estimate_take_equal_steps(method, order):
    exact = np.array([np.cos(2.0), -np.sin(2.0)])
    run = [
        simulate(scenes.oscillator(), 2.0, solver=method, dt=2.0 / n, samples=2) for n in (64, 128)
    ]
    assert [int(motion.steps) for motion in run] == [64, 128]
    errors = [gap(motion.ys[-1], exact) for motion in run]
    assert abs(np.log2(errors[0] / errors[1]) - order) < 0.1
    with pytest.raises(ValueError, match=r"^dt: expected a step, since those of .* are equal"):
        simulate(scenes.oscillator(), 2.0, solver=method)


def test_methods_print_their_names_alone():
    assert repr(solvers.RADAU9) == "Radau('Radau 9', order=9)"
    methods = [x for x in vars(solvers).values() if isinstance(x, Method)]
    assert all(x.name in repr(x) and len(repr(x)) < 60 for x in methods)
    assert "Tsit5" in repr(from_diffrax(diffrax.Tsit5()))
