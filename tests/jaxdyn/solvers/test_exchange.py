"""Solvers exchanged with diffrax: its tables as our methods, our methods as its solvers."""

from typing import ClassVar

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, gap, kepler, kepler_state
from references.order_conditions import OrderConditions

from jaxdyn import Effect, Scene, ensemble, ode, scenes, simulate, solve, until
from jaxdyn.accuracy import convergence, estimates, horizon
from jaxdyn.accuracy.work_precision import work_precision
from jaxdyn.analysis.regularized import logarithmic_span, solve_regularized
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate import phases
from jaxdyn.integrate.events import Reaches
from jaxdyn.integrate.phase import END, Exit, Phase
from jaxdyn.solvers import (
    DOPRI8,
    EULER,
    GAUSS12,
    KAHAN_LI8,
    NYSTROM12,
    RADAU9,
    RK4,
    STOERMER14,
    TAYLOR12,
    VERNER9,
    from_diffrax,
    to_diffrax,
)
from orbits.motion import advance


def _forced(t, y):
    """Two oscillators, one of them forced."""
    q, v = y[:2], y[2:]
    return jnp.concatenate([v, -q * q * q + jnp.stack([jnp.cos(2 * t), 0 * t])])


#: Solvers of diffrax that have a table of an explicit method; all others but Euler are refused.
EXPLICIT = ("Bosh3", "Dopri5", "Dopri8", "Heun", "Midpoint", "Ralston", "Tsit5")


@pytest.mark.parametrize("name", EXPLICIT)
def test_pairs_from_diffrax_have_their_order(name):
    pair = from_diffrax(getattr(diffrax, name)())
    conditions = OrderConditions(pair.a.tolist())
    method = conditions.residuals(pair.weights[0, 0].tolist(), pair.order + 1)
    error = conditions.residuals(pair.weights[1, 0].tolist(), pair.error_order, of_error=True)
    # The tables are float64, with entries up to about 30.
    assert conditions.row_sums(pair.c.tolist()) < EXACT
    assert max(method[:-1]) < 2 * EXACT
    assert max(error[:-1]) < 2 * EXACT
    assert min(method[-1], error[-1]) > 1e-6


#: Their steps are their own.
IMPLICIT = ("ImplicitEuler", "Kvaerno3", "Kvaerno4", "Kvaerno5")


def _instance(kind: type):
    """A solver of a class of diffrax; None where the class is a base of others."""
    if kind.__name__.startswith("Abstract"):
        return None
    wraps = issubclass(kind, diffrax.AbstractWrappedSolver)
    return kind(diffrax.Tsit5()) if wraps else kind()


def test_every_other_solver_of_diffrax_is_refused():
    classes = [x for x in vars(diffrax).values() if isinstance(x, type)]
    kinds = [x for x in classes if issubclass(x, diffrax.AbstractSolver)]
    solvers = {kind.__name__: _instance(kind) for kind in kinds}
    taken = (*EXPLICIT, *IMPLICIT, "Euler")
    refused = {n: s for n, s in solvers.items() if s is not None and n not in taken}
    assert len(refused) >= 20
    for name, solver in refused.items():
        wanted = f"^solver: expected a Runge-Kutta solver of diffrax, got {name}, which "
        with pytest.raises(ValueError, match=wanted):
            from_diffrax(solver)


@pytest.mark.parametrize("name", ["KenCarp3", "KenCarp4", "KenCarp5", "Sil3"])
def test_solvers_of_rates_in_two_parts_are_refused_with_one_of_a_whole_rate(name):
    # diffrax refuses them for a single term; with all of it implicit they ran into the step limit.
    with pytest.raises(ValueError, match=r"in two parts.*diffrax\.Kvaerno5"):
        from_diffrax(getattr(diffrax, name)())


class _Diagonal(diffrax.AbstractDIRK):
    """A tableau of one's own: the implicit midpoint rule."""

    tableau = diffrax.ButcherTableau(
        c=np.zeros(1),
        b_sol=np.array([1.0, 0.0]),
        b_error=np.array([1.0, -1.0]),
        a_lower=(np.array([0.0]),),
        a_predictor=(np.array([1.0]),),
        a_diagonal=np.array([0.5, 0.0]),
        c1=0.5,
    )
    interpolation_cls = diffrax.LocalLinearInterpolation
    root_finder = diffrax.VeryChord(1e-3, 1e-6)
    root_find_max_steps = 10

    def order(self, terms):
        return 2


@pytest.mark.parametrize(
    ("solver", "message"),
    [
        (diffrax.LeapfrogMidpoint(), r"got LeapfrogMidpoint, which has no Butcher tableau of"),
        (diffrax.SRA1(), r"got SRA1, which has no Butcher tableau of an ODE\. Use one of jaxd"),
        (
            diffrax.Tsit5,
            r"got Tsit5, which is not a solver\. Pass an instance, such as diffrax\.Tsit5",
        ),
        (3, r"got int, which is not a solver\. Pass an instance, such as diffrax\.Tsit5\(\)"),
    ],
    ids=lambda x: type(x).__name__,
)
def test_from_diffrax_says_what_to_take_instead(solver, message):
    wanted = f"^solver: expected a Runge-Kutta solver of diffrax, {message}"
    with pytest.raises(ValueError, match=wanted):
        from_diffrax(solver)


def test_from_diffrax_takes_the_steps_of_diffrax():
    solver, y = diffrax.Dopri8(), jnp.array([0.3, -0.2, 0.5, 1.1])
    term = diffrax.ODETerm(lambda t, y, args: _forced(t, y))
    state = solver.init(term, 0.7, 1.1, y, None)
    y1, error, *_ = solver.step(term, 0.7, 1.1, y, None, state, made_jump=False)
    increment, estimate = from_diffrax(solver).advance(_forced, 0.7, 0.4, y)[:2]
    assert gap(y + increment, y1) < EXACT
    assert gap(abs(estimate), abs(error)) < EXACT


def test_equal_solvers_of_diffrax_are_one_method():
    assert from_diffrax(diffrax.Dopri8()) is DOPRI8
    assert from_diffrax(diffrax.Tsit5()) is from_diffrax(diffrax.Tsit5(scan_kind="lax"))
    assert from_diffrax(diffrax.Tsit5()) is not from_diffrax(diffrax.Dopri5())
    assert from_diffrax(diffrax.Euler()) is EULER


class Counted(Effect):
    """A drag that notes each trace of its force."""

    traces: ClassVar[list] = []

    def force(self, t, r, v, m):
        self.traces.append(None)
        return -0.1 * v


COUNTED = Scene(FreePoints(1.0), (Counted(),), y0=[1.0, 0.0, -1.0, 1.0])


def _phased(solver):
    leg = Phase(COUNTED, (Exit(Reaches(0, 0.9, -1), END),))
    return phases.simulate_phases(
        {"swing": leg}, "swing", COUNTED.y0, 1.0, samples=4, solver=solver
    ).y


#: Every call that takes a solver, as a function of it.
CALLS = {
    "simulate": lambda solver: simulate(COUNTED, samples=4, solver=solver).ys,
    "solve": lambda solver: solve(COUNTED, 1.0, solver=solver).y1,
    "until": lambda solver: until(COUNTED, Reaches(0, 0.9), solver=solver).t,
    "phases": _phased,
    "ensemble": lambda solver: (
        ensemble.run(COUNTED, np.ones((2, 4)), solver=solver, chunk=2, threads=1).y1
    ),
    "stream": lambda solver: (
        next(ensemble.stream(COUNTED, [np.ones((2, 4))], solver=solver, chunk=2, threads=1)).y1
    ),
    "fixed_steps": lambda solver: convergence.fixed_steps(COUNTED, steps=5, method=solver),
    "advanced": lambda solver: advance(COUNTED, 1.0, rtol=1e-9, solver=solver).y1,
}


@pytest.mark.sample("solve", "stream", "fixed_steps", "advanced")
@pytest.mark.parametrize("name", CALLS)
def test_solvers_of_diffrax_are_taken_wherever_a_solver_is(name):
    call = CALLS[name]
    ours = call(DOPRI8)
    before = len(Counted.traces)
    # A new instance at each call: neither it nor the first one compiles anything.
    assert gap(call(diffrax.Dopri8()), ours) == 0
    assert gap(call(diffrax.Dopri8()), ours) == 0
    assert len(Counted.traces) == before
    with pytest.raises(ValueError, match=r"^solver: .* got SRA1, which has no Butcher tableau"):
        call(diffrax.SRA1())


def stiff(k):
    """A state that follows cos t within about 1 / k."""
    return ode(lambda t, y, k: -k * (y - jnp.cos(t)), [1.0], 1.0, params=k)


def followed(k, t):
    """The exact solution, but for what dies away at once."""
    return k * (k * np.cos(t) + np.sin(t)) / (1 + k * k)


@pytest.mark.sample("ImplicitEuler-float-float")
@pytest.mark.parametrize(
    ("solver", "rtol", "goal"),
    [
        (diffrax.Kvaerno5(), 1e-9, 1e-9),
        (diffrax.ImplicitEuler(), 1e-5, 1e-3),
        (_Diagonal(), 1e-6, 1e-4),
    ],
    ids=lambda x: type(x).__name__,
)
def test_implicit_solvers_of_diffrax_take_their_own_steps(solver, rtol, goal):
    k = 1e4
    motion = simulate(stiff(k), samples=5, solver=solver, rtol=rtol)
    assert gap(motion.ys[1:, 0], followed(k, motion.ts[1:])) < goal
    assert motion.steps < 3000  # an explicit method takes more than 1e4 / 3.3
    assert simulate(stiff(k), samples=5, solver=type(solver)(), rtol=rtol).ys[-1] == motion.ys[-1]


@pytest.mark.slow
def test_implicit_solvers_of_diffrax_have_derivatives_and_events():
    k, solver = 100.0, diffrax.Kvaerno5()

    def end(k):
        return solve(stiff(k), 1.0, solver=solver, rtol=1e-10).y1[0]

    exact = (followed(k + 1e-3, 1.0) - followed(k - 1e-3, 1.0)) / 2e-3
    assert abs(jax.grad(end)(k) - exact) < 1e-9
    assert abs(jax.jit(jax.jacfwd(end))(k) - exact) < 1e-9
    passed = until(stiff(k), Reaches(0, 0.8), solver=solver, rtol=1e-10)
    assert abs(followed(k, float(passed.t)) - 0.8) < 1e-9


@pytest.mark.slow
def test_a_step_of_diffrax_is_its_own():
    solver, y = diffrax.Kvaerno5(root_finder=diffrax.VeryChord(1e-8, 1e-8)), jnp.array([0.3, 1.1])
    term = diffrax.ODETerm(lambda t, y, args: jnp.stack([y[1], jnp.cos(t) - y[0] ** 3]))
    begin, end = jnp.zeros(()), jnp.asarray(0.01)
    state = solver.init(term, begin, end, y, None)
    y1, error, *_ = solver.step(term, begin, end, y, None, state, made_jump=False)
    found = from_diffrax(solver).advance(lambda t, y: term.vf(t, y, None), begin, end, y)
    assert gap(y + found.increment, y1) < EXACT
    assert gap(found.error, abs(error)) < EXACT


def test_a_solver_of_diffrax_may_be_an_argument_of_a_compiled_function():
    def end(angle, solver):
        return solve(scenes.pendulum(angle=angle), 1.0, rtol=1e-10, solver=solver).y1

    # It is taken apart and put together again.
    assert gap(jax.jit(end)(1.0, diffrax.Tsit5()), end(1.0, diffrax.Tsit5())) < EXACT


def test_a_step_is_asked_for_where_a_solver_of_diffrax_has_no_error_estimate():
    with pytest.raises(ValueError, match=r"^dt: expected a step, since those of Euler are equal"):
        simulate(COUNTED, solver=diffrax.Euler())
    motion = simulate(COUNTED, samples=2, solver=diffrax.Euler(), dt=0.01)
    assert motion.method is EULER
    assert int(motion.steps) == 100


@pytest.mark.slow
def test_estimates_take_solvers_of_diffrax():
    scene, tsit5 = scenes.pendulum(), diffrax.Tsit5()
    found = estimates.estimate(scene, 1.0, samples=3, rtol=1e-6, solver=tsit5)
    assert found.solver == "Tsit5"
    both = estimates.by_second_method(
        scene, 1.0, samples=3, rtol=1e-6, solver=tsit5, second=diffrax.Dopri5()
    )
    assert (both.solver, both.other) == ("Tsit5", "Dopri5")
    with pytest.raises(ValueError, match=r"^second: expected another solver, got Tsit5"):
        estimates.by_second_method(scene, 1.0, solver=tsit5, second=diffrax.Tsit5())
    assert estimates.by_tangents(scene, 1.0, samples=3, solver=tsit5).solver == "Tsit5"
    assert estimates.by_halving(scene, 1.0, steps=64, method=tsit5).solver == "Tsit5"
    assert horizon.trusted_time(scene, 1.0, samples=3, solver=tsit5).t == 1.0
    curves = work_precision(scene, 1.0, solvers=[tsit5], tolerances=[1e-5], rounds=1)
    assert [curve.solver for curve in curves.curves] == ["Tsit5"]
    digits = simulate(scene, 1.0, samples=3, solver=tsit5, digits=6)
    assert digits.error.solver == "Tsit5"


@pytest.mark.slow
def test_logarithmic_time_takes_solvers_of_diffrax():
    scene = scenes.two_body()
    s = logarithmic_span(scene, 1.0)
    ends = [solve_regularized(scene, 1.0, s, solver=x).y1 for x in (diffrax.Tsit5(), None)]
    assert gap(*ends) < 1e-6


def _diffeqsolve(scene, method, t1=2.0, **how):
    control = diffrax.PIDController(rtol=1e-12, atol=1e-12)
    if not method.adaptive:
        control = diffrax.ConstantStepSize()
    dt = None if method.adaptive else 0.02
    how = {"stepsize_controller": control, "max_steps": 512} | how
    return diffrax.diffeqsolve(scene.term(), to_diffrax(method), 0.0, t1, dt, scene.y0, **how)


#: Methods of all kinds, and the error of their motions of two bodies at a tolerance of 1e-12, or of
#: their steps of 0.02.
HANDED = [(VERNER9, 1e-11)]
HANDED += [
    pytest.param(method, error, marks=pytest.mark.slow)
    for error, methods in {
        1e-10: (STOERMER14, TAYLOR12),
        1e-5: (RK4,),
        1e-11: (NYSTROM12, GAUSS12, KAHAN_LI8, RADAU9, from_diffrax(diffrax.Tsit5())),
    }.items()
    for method in methods
]


@pytest.mark.slow
@pytest.mark.parametrize(("method", "error"), HANDED, ids=lambda x: getattr(x, "name", ""))
def test_between_steps_a_method_in_diffrax_is_as_right_as_its_steps(method, error):
    ts = np.linspace(0.0, 2.0, 33)
    exact = np.array([kepler_state(0.3, t) for t in ts])
    subs = [diffrax.SubSaveAt(ts=ts), diffrax.SubSaveAt(steps=True)]
    run = _diffeqsolve(kepler(0.3), method, saveat=diffrax.SaveAt(subs=subs, dense=True))
    n, nodes = int(run.stats["num_accepted_steps"]), run.ys[1]
    steps = gap(nodes[:n], [kepler_state(0.3, float(t)) for t in run.ts[1][:n]])
    assert steps < error
    # A line between the nodes would be off by 1e-4 and more.
    assert gap(run.ys[0], exact) < 1.1 * steps + EXACT
    assert gap(jax.vmap(run.evaluate)(jnp.asarray(ts)), exact) < 1.1 * steps + EXACT
    change = run.evaluate(ts[3], ts[7])
    assert gap(change, exact[7] - exact[3]) < 2.2 * steps + EXACT
    rates = jax.vmap(kepler(0.3).rate)(jnp.asarray(ts), jnp.asarray(exact))
    assert gap(jax.vmap(run.derivative)(jnp.asarray(ts)), rates) < 100 * steps + 100 * EXACT
    # Where nothing is saved between steps, it is the same motion.
    assert gap(_diffeqsolve(kepler(0.3), method).ys[-1], nodes[n - 1]) < EXACT


@pytest.mark.slow
def test_methods_in_diffrax_go_backwards_and_have_derivatives():
    back = _diffeqsolve(kepler(0.3), VERNER9, t1=-2.0, saveat=diffrax.SaveAt(ts=[-0.7, -2.0]))
    assert gap(back.ys, [kepler_state(0.3, t) for t in (-0.7, -2.0)]) < 1e-10

    def end(angle):
        run = _diffeqsolve(scenes.pendulum(angle=angle), VERNER9, saveat=diffrax.SaveAt(ts=[1.5]))
        return run.ys[0, 0]

    slope = jax.grad(lambda angle: solve(scenes.pendulum(angle=angle), 1.5).y1[0])(1.0)
    assert abs(jax.grad(end)(1.0) - slope) < 1e-9


def test_diffrax_is_told_how_to_take_a_method():
    scene = kepler(0.3)
    with pytest.raises(ValueError, match=r"got Verner 9\(8\) of jaxdyn\. Pass .*to_diffrax"):
        diffrax.diffeqsolve(scene.term(), VERNER9, 0.0, 1.0, 0.1, scene.y0)
    with pytest.raises(ValueError, match=r"^method: expected one of jaxdyn\.solvers, got Tsit5"):
        to_diffrax(diffrax.Tsit5())
    with pytest.raises(RuntimeError, match="does not provide error estimates"):
        _diffeqsolve(scene, RK4, stepsize_controller=diffrax.PIDController(rtol=1e-6, atol=1e-6))


@pytest.mark.parametrize(
    "rate",
    [
        lambda t, y, args: jnp.concatenate([y[2:], -y[:2] - 0.1 * y[2:]]),
        lambda t, y, args: jnp.concatenate([2 * y[2:], -y[:2]]),
    ],
    ids=["drag", "momenta"],
)
def test_a_method_for_positions_refuses_other_rates_in_diffrax(rate):
    with pytest.raises(RuntimeError, match=r"got Nystrom 12\(10\)\. It requires dq/dt = v"):
        diffrax.diffeqsolve(
            diffrax.ODETerm(rate), to_diffrax(NYSTROM12), 0.0, 1.0, 0.1, jnp.arange(4.0)
        )


@pytest.mark.parametrize(
    ("y0", "message"),
    [
        ((jnp.ones(2), jnp.ones(2)), r"got tuple\. Join its parts"),
        (jnp.ones((2, 2)), r"got float64\[2,2\]"),
    ],
)
def test_states_of_other_forms_are_refused_in_diffrax(y0, message):
    term = diffrax.ODETerm(lambda t, y, args: y)
    wanted = rf"^y0: expected one array \(k,\) of float64, {message}"
    with pytest.raises(ValueError, match=wanted):
        diffrax.diffeqsolve(term, to_diffrax(VERNER9), 0.0, 1.0, 0.1, y0)
