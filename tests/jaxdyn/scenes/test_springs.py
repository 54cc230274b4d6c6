"""Spring scenes: closed forms and the limits of problem 6 c."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap
from scipy.integrate import solve_ivp

from jaxdyn import Trajectory, simulate, vibration
from jaxdyn.analysis import energy, linearize
from jaxdyn.effects import CubicSpring, Damper, Dashpot, LinearDrag, Spring, UniformGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scenes.springs import (
    hanging_spring,
    hanging_spring_exact,
    oscillator,
    spring_chain,
    spring_mass,
    two_masses,
    two_masses_exact,
    two_springs,
    wildness,
)

TIGHT = {"rtol": 1e-13, "samples": 5}


def test_problem_3_oscillator_in_closed_form():
    motion = simulate(oscillator(k=9.0, m=4.0, x=0.5, v=-2.0), 7.0, **TIGHT)
    w, t = 1.5, motion.ts
    assert gap(motion["x"], 0.5 * jnp.cos(w * t) - 2.0 / w * jnp.sin(w * t)) < SOLVED


@pytest.fixture(scope="module")
def solve_spring_mass():
    """States (5, 4) at 5 times up to 2 s: one compiled program for all limits of 6 c."""

    def solve(position, velocity, k, length, g):
        numbers = {"position": position, "velocity": velocity, "k": k, "length": length, "g": g}
        motion = simulate(spring_mass(**numbers), 2.0, **TIGHT, throw=False)
        return motion.ts, motion.ys, energy.drift(motion)

    compiled = jax.jit(solve)

    def call(position, velocity, *, k, length, g):
        args = [jnp.asarray(x, float) for x in (position, velocity, k, length, g)]
        return [np.asarray(x) for x in compiled(*args)]

    return call


def test_problem_6_c_i_without_stiffness_it_is_a_parabola(solve_spring_mass):
    t, y, _ = solve_spring_mass((1.0, 2.0), (0.5, 3.0), k=0.0, length=0.7, g=9.81)
    expected = np.stack([1 + 0.5 * t, 2 + 3 * t - 9.81 * t**2 / 2], axis=-1)
    assert gap(y[:, :2], expected) < 10 * SOLVED


def test_problem_6_c_ii_on_the_vertical_it_stays_there(solve_spring_mass):
    _, y, drift = solve_spring_mass((0.0, -1.0), (0.0, 2.0), k=10.0, length=0.5, g=9.81)
    assert gap(y[:, [0, 2]], np.zeros((5, 2))) == 0
    assert drift < SOLVED


def test_problem_6_c_iii_without_gravity_from_rest_it_swings_on_a_ray(solve_spring_mass):
    t, y, _ = solve_spring_mass((0.6, 0.8), (0.0, 0.0), k=4.0, length=0.7, g=0.0)
    # r* = r - L is a harmonic oscillator as long as the origin is not passed
    r = 0.7 + 0.3 * np.cos(2 * t)
    assert gap(y[:, :2], r[:, None] * np.array([0.6, 0.8])) < SOLVED


def test_problem_6_c_iv_rest_length_zero_is_an_ellipse(solve_spring_mass):
    t, y, _ = solve_spring_mass((1.0, 2.0), (0.5, 3.0), k=10.0, length=0.0, g=9.81)
    scene = hanging_spring(position=(1.0, 2.0), velocity=(0.5, 3.0))
    assert gap(y, hanging_spring_exact(scene, t)) < 10 * SOLVED


def test_problem_6_c_v_circles_without_gravity(solve_spring_mass):
    # m v^2 / r = k (r - L)
    r, k, length = 1.2, 10.0, 0.5
    v = np.sqrt(r * k * (r - length))
    t, y, _ = solve_spring_mass((r, 0.0), (0.0, v), k=k, length=length, g=0.0)
    expected = r * np.stack([np.cos(v / r * t), np.sin(v / r * t)], axis=-1)
    assert gap(y[:, :2], expected) < 10 * SOLVED


@pytest.mark.slow
def test_problem_6_c_vi_energy_and_a_plane_in_space(solve_spring_mass):
    _, _, drift = solve_spring_mass((1.0, 0.3), (0.4, -1.0), k=10.0, length=0.5, g=9.81)
    assert drift < SOLVED
    scene = spring_mass(position=(1.0, 2.0, 0.5), velocity=(0.5, 1.0, 0.0), length=0.7)
    motion = simulate(scene, 2.0, **TIGHT)
    # (x, y) and (vx, vy) parallel at the start: the motion keeps the vertical plane of both.
    assert gap(motion["y"], 2 * motion["x"]) < SOLVED
    assert energy.drift(motion) < SOLVED


def test_problem_6_c_vii_small_swings_have_two_known_frequencies():
    k, m, g, length = 10.0, 2.0, 9.0, 0.5
    hanging = -(length + m * g / k)
    scene = spring_mass(position=(0.0, hanging), k=k, m=m, g=g, length=length)
    modes = linearize.modes(scene)
    assert gap(modes.squares, [g / -hanging, k / m]) < 100 * EXACT


@pytest.mark.slow
def test_problem_10_every_motion_is_one_ellipse_in_closed_form():
    scene = hanging_spring(position=(1.0, -0.5, 0.3), velocity=(0.7, 1.0, 2.0), k=3.0, m=2.0)
    motion = simulate(scene, 6.0, **TIGHT)
    assert gap(motion.ys, hanging_spring_exact(scene, motion.ts)) < 10 * SOLVED
    # All of it in one plane, and over after one period.
    exact = hanging_spring_exact(scene, jnp.linspace(0.0, 2 * np.pi * np.sqrt(2 / 3), 50))
    r = np.asarray(exact[:, :3])
    assert np.linalg.svd(r - r[:-1].mean(axis=0))[1][2] < 100 * EXACT
    assert gap(exact[-1], exact[0]) < 10 * EXACT
    weightless = hanging_spring(g=0.0)
    assert [type(e) for e in weightless.effects] == [Spring]
    assert gap(hanging_spring_exact(weightless, 0.0), weightless.y0) == 0


@pytest.mark.slow
def test_problem_10_no_start_is_wild_and_a_rest_length_makes_it_so():
    starts = np.random.default_rng(10).normal(size=(5, 2, 3)) * 3
    for position, velocity in starts:
        scene = hanging_spring(position=position, velocity=velocity)
        found = [float(wildness(simulate(scene, 8.0, rtol=r))) for r in (1e-3, 1e-6, 1e-13)]
        assert found[0] > found[2]  # what coarse numerics add goes away
        assert found[1] < 1e-4
        assert found[2] < 1e-11
    numbers = {"position": starts[0, 0], "velocity": starts[0, 1]}
    scenes = [spring_mass(length=x, **numbers) for x in (0.01, 0.1, 1.0)]
    wild = [[float(wildness(simulate(s, 8.0, rtol=r))) for r in (1e-9, 1e-13)] for s in scenes]
    assert wild[0][1] > 1e-4
    assert wild[1][1] > 5 * wild[0][1]
    assert wild[2][1] > 5 * wild[1][1]
    assert np.ptp(wild, axis=1).max() < 1e-6  # these are properties of the system


def test_wildness_of_made_up_paths():
    scene, t = hanging_spring(), np.linspace(0.0, 5.0, 60)

    def moved(r):
        states = jnp.asarray(np.concatenate([r, 0 * r], axis=1))
        return Trajectory(scene, jnp.asarray(t), states, *[jnp.zeros((), int)] * 3)

    ellipse = np.stack([np.cos(2 * t), 3 * np.sin(2 * t), np.cos(2 * t + 1) - 4], axis=1)
    assert float(wildness(moved(ellipse))) < 1e-12
    two = ellipse + np.stack([0 * t, 0 * t, np.cos(4 * t)], axis=1)
    assert float(wildness(moved(two))) > 0.3
    with pytest.raises(ValueError, match="motion: expected 5 even samples or more, got 4 samples"):
        wildness(simulate(scene, samples=4))
    with pytest.raises(ValueError, match="motion: expected 5 even samples or more"):
        wildness(simulate(scene, samples=np.array([0.0, 0.1, 0.2, 0.3, 0.5])))


def test_problem_13_leaves_out_what_is_exactly_zero():
    def kinds(**numbers):
        return [type(e) for e in two_springs(**numbers).effects]

    assert kinds() == [Spring, Spring, UniformGravity]
    assert kinds(k_a=0.0, g=0.0, c_a=1.0, c_b=1.0, c_d=1.0) == [
        Spring,
        Dashpot,
        Dashpot,
        LinearDrag,
    ]


def test_problem_13_forces_by_hand():
    scene = two_springs(c_a=0.5, c_b=0.25, c_d=0.1, m=2.0, k_a=10.0, k_b=20.0)
    y = jnp.array([-1.0, 2.0, 3.0, -1.0])
    root = np.sqrt(8.0)  # from B at (1, 0); straight above A by 2
    away = np.array([-2.0, 2.0]) / root
    force = np.array([0.0, -10 * 0.5]) - 20 * (root - 1.5) * away + np.array([0.0, 0.5])
    force += -0.25 * (away @ [3.0, -1.0]) * away - 0.1 * np.array([3.0, -1.0]) + [0.0, -2.0]
    assert gap(scene.rate(0.0, y), [3.0, -1.0, *(force / 2)]) < 10 * EXACT


STIFF = {"m1": 1.0, "m2": 3.0, "force": 2.0}


@pytest.mark.slow
def test_problem_20_against_the_closed_form_and_the_centre_of_mass():
    scene = two_masses(k=50.0, length=0.8, **STIFF)
    motion = simulate(scene, 3.0, **TIGHT)
    assert gap(motion.ys, two_masses_exact(motion.ts, k=50.0, length=0.8, **STIFF)) < 10 * SOLVED
    # 20 b: F = (m1 + m2) a_G at any state and stiffness
    y = jnp.array([0.3, 0.1, -5.0, 2.0])
    total = jnp.sum(jnp.array([1.0, 3.0]) * scene.rate(0.0, y)[2:])
    assert gap(total, 2.0) < 10 * EXACT


def test_problem_20_c_a_stiff_pair_moves_like_one_mass_to_order_1_over_k():
    t = np.linspace(0, 3, 2001)
    rigid = 0.5 * 2.0 / 4.0 * t**2
    off = []
    for k in (1e2, 1e4, 1e6):
        y = np.asarray(two_masses_exact(t, k=k, length=0.8, **STIFF))
        off.append([np.max(np.abs(y[:, 0] - rigid)), np.max(np.abs(y[:, 1] - 0.8 - rigid))])
        # largest distances, as the docstring has them
        share = 2 * 2.0 * 1.0 / (k * 4.0**2)
        assert gap(np.array(off[-1]) / share, [3.0, 1.0]) < 1e-3
    assert two_masses(force=0.0).effects[0].k == 100.0
    assert len(two_masses(force=0.0).effects) == 1


M, K, C = (2.0, 1.0, 0.5), (30.0, 10.0, 5.0, 20.0), (0.3, 0.1, 0.2, 0.4)


def matrix(coefficients):
    """The matrix of springs or dampers in a row between two walls."""
    stretches = np.eye(4, 3) - np.eye(4, 3, k=-1)
    return stretches.T @ np.diag(coefficients) @ stretches


def test_a_chain_has_the_matrices_of_its_springs_and_dampers():
    found = vibration.modes(spring_chain(m=M, k=K, c=C))
    assert gap(found.mass, np.diag(M)) < EXACT
    assert gap(found.stiffness, matrix(K)) < 100 * EXACT
    assert gap(found.damping, matrix(C)) < 10 * EXACT
    free = vibration.modes(spring_chain(m=M[:2], k=K[:2]))
    assert gap(free.stiffness, [[40.0, -10.0], [-10.0, 10.0]]) < 100 * EXACT
    loose = vibration.modes(spring_chain(m=M[:2], k=(0.0, 10.0)))
    assert gap(loose.stiffness, [[10.0, -10.0], [-10.0, 10.0]]) < 100 * EXACT


def test_a_chain_with_cubic_springs_and_a_moving_wall_against_scipy():
    beta, wall, velocity = (2.0, 0.0, -1.0, 3.0), 0.3, -0.2
    x, v = (0.5, -0.2, 0.1), (0.0, 1.0, 0.0)
    scene = spring_chain(
        m=M, k=K, c=C, cubic=beta, x=x, v=v, wall=wall, wall_velocity=velocity, spacing=2.0
    )

    def rate(t, y):
        del t
        x, v = y[:3], y[3:]
        stretch = np.diff(np.concatenate([[wall], x, [0.0]]))
        opening = np.diff(np.concatenate([[velocity], v, [0.0]]))
        pull = np.array(K) * stretch + np.array(beta) * stretch**3 + np.array(C) * opening
        return np.concatenate([v, np.diff(pull) / np.array(M)])

    motion = simulate(scene, 3.0, **TIGHT)
    options = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14, "t_eval": motion.ts}
    known = solve_ivp(rate, (0.0, 3.0), np.concatenate([x, v]), **options)
    assert gap(motion.ys, known.y.T) < 10 * SOLVED
    places = scene.system.places(jnp.zeros(()), scene.y0)[:, 0]
    assert gap(places, np.add(x, (2.0, 4.0, 6.0))) < EXACT


def test_a_chain_gives_one_number_to_all_and_leaves_out_what_is_zero():
    assert spring_chain(m=(1.0, 2.0, 3.0), k=5.0, x=0.1).y0.tolist() == 3 * [0.1] + 3 * [0.0]
    kinds = [type(e) for e in spring_chain(k=(1.0, 0.0), c=(0.0, 0.3), cubic=(0.0, 2.0)).effects]
    assert kinds == [Spring, CubicSpring, Damper]
    slope = jax.grad(lambda k: spring_chain(k=k).rate(0.0, jnp.ones(4))[2])(jnp.ones(2))
    assert slope.tolist() == [-1.0, 0.0]
    one = jax.grad(lambda k: spring_chain(k=(k, 3.0)).rate(0.0, jnp.ones(4))[2])(1.0)
    assert one == -1.0
    beside = jax.eval_shape(lambda k: spring_chain(k=(k, 0.0), x=(k, 0.0)), 1.0)
    assert [type(e) for e in beside.effects] == [Spring]


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ({"k": (1.0,) * 4}, "k: expected one number, or 2 or 3, one for each spring"),
        ({"k": (1.0,) * 3, "c": (1.0, 2.0)}, "c: expected one number, or 3, one for each spring"),
        ({"x": (1.0,) * 3}, "x: expected one number, or 2, one for each mass"),
        ({"m": ()}, "m: expected at least one mass, got none"),
        ({"m": (1.0, -2.0)}, "mass: expected"),
        ({"cubic": float("nan")}, "beta: expected"),
        ({"k": ((1.0, 2.0),)}, "k: expected"),
        ({"x": ()}, "x: expected one number, or 2, one for each mass, got 0 numbers"),
    ],
)
def test_numbers_that_make_no_chain_are_refused(numbers, said):
    with pytest.raises(ValueError, match=said):
        spring_chain(**numbers).check()


def test_the_spacing_of_a_chain_is_for_drawings_alone():
    with pytest.raises(ValueError, match="spacing: expected numbers, got values traced"):
        jax.jit(lambda spacing: spring_chain(spacing=spacing).y0)(2.0)
    with pytest.raises(ValueError, match=r"rest: expected shape \(2, 1\), got shape \(1, 1\)"):
        FreePoints([1.0, 1.0], 1, rest=[(1.0,)]).check(0.0, jnp.zeros(4))
