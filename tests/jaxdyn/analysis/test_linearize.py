"""Jacobians, verdicts and modes against matrices and oscillators whose answers are known."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import DIFFED, EXACT, Arm, central_difference, gap, refusal

from jaxdyn import Effect, Scene, ode, simulate
from jaxdyn.analysis import linearize
from jaxdyn.analysis.constraints import conditioning
from jaxdyn.analysis.eigenvalues import ERROR_SAFETY, ROUNDING, eigenvalues
from jaxdyn.analysis.equilibria import equilibria, equilibrium
from jaxdyn.effects import SpringNetwork, UniformGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.formulations.newton_euler import NewtonEuler
from jaxdyn.scenes.lorenz_system import lorenz
from jaxdyn.scenes.nbody import two_body
from jaxdyn.scenes.pendula import pendulum
from jaxdyn.scenes.springs import oscillator, two_springs

# (matrix, verdict, portrait)
MATRICES = [
    ([[-1.0, 0.0], [0.0, -2.0]], "stable", "node"),
    ([[1.0, 0.5], [0.0, 2.0]], "unstable", "node"),
    ([[-0.1, 1.0], [-1.0, -0.1]], "stable", "spiral"),
    ([[0.1, 1.0], [-1.0, 0.1]], "unstable", "spiral"),
    ([[0.0, 1.0], [-4.0, 0.0]], "undecided", "centre"),
    ([[1.0, 0.0], [0.0, -1.0]], "unstable", "saddle"),
    ([[0.0, 1.0], [0.0, 0.0]], "undecided", "degenerate"),  # a free particle: defective
    ([[0.0, 0.0], [0.0, 0.0]], "undecided", "degenerate"),
    ([[0.0, 0.0], [0.0, -1.0]], "undecided", "degenerate"),
    ([[-1.0, 0, 0], [0, -0.1, 2.0], [0, -2.0, -0.1]], "stable", "mixed"),
    ([[-1e-17, 1.0], [-1.0, -1e-17]], "undecided", "centre"),  # damping below rounding
    ([[-1e-12, 1.0], [-1.0, -1e-12]], "stable", "spiral"),  # and above
]


@pytest.mark.parametrize(("a", "verdict", "portrait"), MATRICES)
def test_matrices_of_known_kind(a, verdict, portrait):
    found = linearize.classify(a)
    assert (found.verdict, found.portrait) == (verdict, portrait)


def test_a_kind_is_that_of_the_matrix_in_any_coordinates():
    rng = np.random.default_rng(4)
    for a, verdict, portrait in MATRICES:
        if portrait == "degenerate" or abs(np.max(np.linalg.eigvals(a).real)) == 1e-12:
            continue  # in rounded coordinates these are other matrices
        s = rng.normal(size=np.shape(a)) + 3 * np.eye(len(a))
        found = linearize.classify(s @ np.array(a) @ np.linalg.inv(s))
        assert (found.verdict, found.portrait) == (verdict, portrait)


def test_error_bars_cover_the_split_of_a_defective_eigenvalue():
    s = np.random.default_rng(5).normal(size=(3, 3))
    a = s @ np.array([[2.0, 1, 0], [0, 2, 1], [0, 0, 2]]) @ np.linalg.inv(s)
    found = linearize.classify(a)
    off = np.abs(found.eigenvalues - 2.0)
    assert (off < found.bars).all()
    assert off.max() > 1e-7  # far above rounding


@pytest.mark.parametrize("error", [0.0, 1e-7])
def test_simple_eigenvalues_beside_defective_ones_have_their_own_bars(error):
    rng = np.random.default_rng(3)
    # Five double zeros, as many conserved quantities leave them, and a pair.
    plain = np.zeros((12, 12))
    plain[range(0, 10, 2), range(1, 11, 2)] = 1.0
    plain[10, 10], plain[11, 11] = 2.5, -2.5
    a = plain + np.triu(rng.normal(size=(12, 12)), 10)
    for _ in range(20):
        e = rng.normal(size=a.shape)
        moved = a + error * e / np.linalg.norm(e, 2)
        values, bars = eigenvalues(a, error / ERROR_SAFETY)
        others = np.linalg.eigvals(moved)
        for wanted in (2.5, -2.5):
            which = np.argmin(np.abs(values - wanted))
            off = np.abs(others - values[which]).min()
            assert off <= bars[which] < max(100 * error, 1e-12)
    assert bars[np.argmin(np.abs(values))] > 0.1  # of a double zero


@pytest.mark.parametrize("size", [1.0, 1e10, 1e20, 1e25])
def test_error_bars_of_a_defective_matrix_are_finite_at_any_size(size):
    bars = linearize.classify([[0.0, size], [0.0, 0.0]]).bars
    elsner = np.sqrt(2 * size * ERROR_SAFETY * ROUNDING * size)
    assert gap(bars / elsner, np.ones(2)) < EXACT


def test_the_jacobian_is_the_derivative_of_the_rate():
    for scene in (two_springs(c_a=0.3, c_d=0.2), lorenz()):
        difference = central_difference(lambda y, s=scene: s.rate(0.0, y), scene.y0)
        assert gap(linearize.jacobian(scene, scene.y0), difference) < 100 * DIFFED


def test_lorenz_origin_and_wings():
    sigma, rho, beta = 10.0, 28.0, 8 / 3
    origin = linearize.linearize(lorenz(), [0.0, 0.0, 0.0])
    root = np.sqrt((sigma - 1) ** 2 + 4 * sigma * rho)
    expected = [(-sigma - 1 + root) / 2, -beta, (-sigma - 1 - root) / 2]
    assert gap(origin.eigenvalues.real, expected) < 100 * EXACT
    assert origin.portrait == "saddle"
    # The wings lose their stability at rho = sigma (sigma + beta + 3) / (sigma - beta - 1).
    for factor, verdict in ((0.98, "stable"), (1.02, "unstable")):
        rho = factor * sigma * (sigma + beta + 3) / (sigma - beta - 1)
        w = np.sqrt(beta * (rho - 1))
        assert linearize.linearize(lorenz(rho=rho), [w, w, rho - 1]).verdict == verdict


def test_eigenvalue_of_a_damped_oscillator_against_its_decay():
    scene = oscillator(k=4.0, m=2.0, c=0.4)
    found = linearize.linearize(scene, [0.0, 0.0])
    rate = 0.4 / (2 * 2.0)
    assert gap(found.eigenvalues.real, [-rate, -rate]) < EXACT
    period = 2 * np.pi / found.eigenvalues.imag.max()
    motion = simulate(scene, period, samples=2, rtol=1e-13)
    assert gap(motion.ys[-1], np.exp(-rate * period) * scene.y0) < 1e-12


def _chain(n: int, k: float = 3.0, m: float = 2.0) -> Scene:
    """n masses in a row on n - 1 springs of rest length 1."""
    links = tuple((i, i + 1) for i in range(n - 1))
    springs = SpringNetwork(links, k, 1.0)
    y0 = np.concatenate([np.arange(float(n)), np.zeros(n)])
    return Scene(FreePoints(np.full(n, m), 1), (springs,), y0=y0)


@pytest.mark.slow
def test_modes_of_a_free_chain():
    n = 4
    modes = linearize.modes(_chain(n))
    expected = 4 * (3.0 / 2.0) * np.sin(np.arange(n) * np.pi / (2 * n)) ** 2
    assert gap(modes.squares, expected) < 10 * EXACT
    assert modes.frequencies[0] == 0  # it drifts away; not NaN, not 1e-8
    assert gap(modes.shapes.T @ modes.mass @ modes.shapes, np.eye(n)) < 10 * EXACT
    assert gap(modes.shapes[:, 0] / modes.shapes[0, 0], np.ones(n)) < 10 * EXACT


@pytest.mark.slow
def test_modes_of_a_pendulum_below_and_above():
    scene = Scene(NewtonEuler(Arm()), (UniformGravity(9.0),), y0=[0.0, 0.0])
    assert gap(linearize.modes(scene).squares, [4.5]) < EXACT
    above = linearize.modes(scene, [jnp.pi, 0.0])
    assert gap(above.squares, [-4.5]) < EXACT
    assert np.isnan(above.frequencies).all()


def test_a_frequency_is_differentiable_in_the_numbers_of_the_scene():
    def frequency(k):
        return linearize.modes(oscillator(k=k, m=4.0), jnp.zeros(2)).frequencies[0]

    # w = sqrt(k / m)
    assert gap(jax.grad(frequency)(9.0), 0.5 / np.sqrt(9.0 * 4.0)) < EXACT


@pytest.mark.parametrize(
    "call",
    [
        lambda: linearize.linearize(oscillator(), [0.0, 0.0]),
        lambda: linearize.modes(oscillator(), [0.0, 0.0]),
        lambda: equilibria(oscillator(), [-1.0], [1.0]),
        lambda: equilibrium(oscillator(), [0.0, 0.0]),
        lambda: conditioning(pendulum(formulation="constrained"), 0.0, [0.0, -1.0, 0.0, 0.0]),
    ],
)
def test_32_bit_floats_are_refused(call):
    with jax.enable_x64(False), pytest.raises(ValueError, match=r"^floats: expected 64-bit floats"):
        call()


def test_what_has_no_modes_is_refused():
    with pytest.raises(
        ValueError, match=r"^scene: expected a system with canonical momenta, got L"
    ):
        linearize.modes(lorenz())
    message = (
        r"^y: expected an equilibrium, got velocities \[1\.0\], accelerations \[-1\.0\]\. `equ"
    )
    with pytest.raises(ValueError, match=message):
        linearize.modes(oscillator(), [1.0, 1.0])
    swirl = _chain(2) + Swirl()
    with pytest.raises(ValueError, match=r"^scene: expected conservative forces, got a stiffness "):
        linearize.modes(swirl)
    with pytest.raises(
        ValueError, match=r"^jacobian: expected a square matrix, got shape \(2, 3\)"
    ):
        linearize.classify(np.ones((2, 3)))


class Swirl(SpringNetwork):
    """A force that is no gradient: each point is pushed by the position of the other."""

    def __init__(self):
        super().__init__(((0, 1),), 1.0)

    def force(self, t, r, v, m):
        return jnp.stack([r[1] - 1.0, 0.0 * r[0]])


SWING = pendulum()
COLLIDED = two_body().starting(np.zeros(8))
NO_BODIES = Scene(FreePoints([]), (), y0=[])


class WithoutValue(Effect):
    """A field whose strength is not a number."""

    def potential(self, t, r, m):
        return np.nan * (r * r).sum()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: linearize.linearize(NO_BODIES, []), "system: expected a system with a state"),
        (
            lambda: linearize.linearize(pendulum, [0.0, 0.0]),
            "scene: expected a Scene or a Field, got pendulum",
        ),
        (lambda: linearize.linearize(SWING, [np.nan, 0.0]), "y: expected finite numbers"),
        (lambda: linearize.linearize(SWING, [0.0, 0.0], "now"), "t: expected numbers, got 'now'"),
        (lambda: linearize.linearize(SWING, [0.0, 0.0], np.nan), "t: expected finite numbers"),
        (lambda: linearize.linearize(SWING, [0.0]), "y: expected shape"),
        (
            lambda: linearize.linearize(SWING + WithoutValue(), [0.0, 0.0]),
            "The rate has no derivative there",
        ),
        (lambda: linearize.linearize(pendulum(m=0.0), [0.0, 0.0]), "mass: expected > 0"),
        (
            lambda: linearize.linearize(COLLIDED, COLLIDED.y0),
            "y0: expected bodies at different points",
        ),
        (lambda: linearize.modes(pendulum, [0.0, 0.0]), "scene: expected a Scene, got pendulum"),
        (
            lambda: linearize.modes(SWING + WithoutValue(), [0.0, 0.0]),
            "stiffness: expected finite numbers",
        ),
    ],
)
def test_what_cannot_be_linearised_is_refused_by_name(call, message):
    assert message in refusal(call)


def test_within_jit_modes_are_those_of_a_captured_scene_and_linearize_is_refused():
    rest = oscillator(k=9.0, x=0.0)
    found = jax.jit(lambda w: w * linearize.modes(rest).frequencies)(2.0)
    np.testing.assert_allclose(found, [6.0], rtol=1e-14)
    with pytest.raises(ValueError, match="linearize: expected numbers, got values traced"):
        jax.jit(lambda v: linearize.linearize(rest, jnp.stack([0.0, v])).bars)(0.0)


def _stiffer_behind(t, y):
    return [y[1], -jnp.where(y[0] > 0, 4.0, 1.0) * y[0] - 0.1 * y[1]]


def _half_stable(t, y):
    return [jnp.where(y[0] > 0, y[0], -2 * y[0])]


def test_where_a_rate_bends_the_bars_contain_the_eigenvalues_of_both_sides():
    spring = ode(_stiffer_behind, [0.0, 0.0], 1.0)
    found = linearize.linearize(spring, [0.0, 0.0])
    for stiffness in (1.0, 4.0):
        for value in np.roots([1.0, 0.1, stiffness]):
            assert (np.abs(found.eigenvalues - value) <= found.bars + 1e-14).any()
    assert found.verdict == "undecided"
    assert linearize.linearize(spring, [0.1, 0.0]).verdict == "stable"
    # Pushed away on one side: dx/dt = x or -2 x.
    found = equilibria(ode(_half_stable, [0.5], 1.0), [-1.0], [1.2])
    assert [one.verdict for one in found.linearizations] == ["undecided"]


def test_where_a_rate_jumps_bars_are_infinite_and_where_it_is_smooth_they_are_narrow():
    rubbed = ode(lambda t, y: [y[1], -y[0] - 0.3 * jnp.sign(y[1])], [0.1, 0.0], 1.0)
    assert np.isinf(linearize.linearize(rubbed, [0.1, 0.0]).bars).all()
    # Contact by Hertz's law has no stiffness where it begins.
    touching = ode(
        lambda t, y: [y[1], -y[0] + 1e3 * jnp.maximum(0.0, -y[0]) ** 1.5 - 0.1 * y[1]],
        [0.0, 0.0],
        1.0,
    )
    found = linearize.linearize(touching, [0.0, 0.0])
    assert found.verdict == "stable"
    assert (found.bars < 1e-13).all()
