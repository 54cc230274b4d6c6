"""Steady motions: eigenvalues against closed forms, in several coordinates, and by simulation."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from helpers import gap

from jaxdyn import Scene, simulate
from jaxdyn.analysis import precession
from jaxdyn.analysis.precession import critical_spin
from jaxdyn.analysis.steady import linearize_steady
from jaxdyn.effects import PairGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scene import Effect
from jaxdyn.scenes.bodies import top
from jaxdyn.scenes.disks import rolling_disk
from jaxdyn.scenes.skates import one_skate

TOP = {"m": 0.1, "d": 0.05, "I1": 1e-4, "I3": 5e-5}
THETA, SPIN = 0.5, 200.0


def _nutation(rate: float) -> float:
    """Angular frequency of the nutation [rad/s] about a precession at a rate.

    I theta'' = -dV/dtheta with the conserved momenta p_phi and p_psi, differentiated by mpmath.
    """
    m, d, I3 = TOP["m"], TOP["d"], TOP["I3"]
    I = TOP["I1"] + m * d * d  # noqa: E741 moment of inertia about the pivot
    with mpmath.workdps(40):
        p_psi = I3 * (mpmath.mpf(SPIN) + rate * mpmath.cos(THETA))
        p_phi = I * mpmath.sin(THETA) ** 2 * rate + p_psi * mpmath.cos(THETA)

        def potential(theta):
            swing = p_phi - p_psi * mpmath.cos(theta)
            weight = m * mpmath.mpf("9.81") * d * mpmath.cos(theta)
            return swing**2 / (2 * I * mpmath.sin(theta) ** 2) + weight

        return float(mpmath.sqrt(mpmath.diff(potential, THETA, 2) / I))


@pytest.mark.slow
@pytest.mark.parametrize("representation", ["euler", "quaternion"])
def test_a_top_nutates_about_slow_and_fast_precession(representation):
    roots = precession.top_roots(THETA, SPIN, **TOP)
    for rate in roots.precession:
        scene = top(THETA, precession=rate, spin=SPIN, representation=representation, **TOP)
        found = linearize_steady(scene)
        assert (found.symmetries, found.family) == (2, 2)
        assert (found.reduced.verdict, found.reduced.portrait) == ("undecided", "centre")
        (frequency,) = found.frequencies
        assert abs(frequency - _nutation(float(rate))) < 1e-9
        assert abs(frequency - _nutation(float(rate))) < found.reduced.bars.max()


@pytest.mark.slow
@pytest.mark.parametrize("coordinates", [{}, {"representation": "euler", "sequence": "XYZ"}])
def test_a_sleeping_top_falls_below_its_critical_spin(coordinates):
    critical = float(critical_spin(**TOP))
    I, weight = TOP["I1"] + TOP["m"] * TOP["d"] ** 2, TOP["m"] * 9.81 * TOP["d"]  # noqa: E741
    for part, verdict in ((0.99, "unstable"), (1.01, "undecided")):
        found = linearize_steady(top(0.0, spin=part * critical, **TOP, **coordinates)).reduced
        assert found.verdict == verdict
        # Upright, lambda^2 - i (I_3 n / I) lambda - weight / I = 0 for x + i y.
        grows = np.sqrt(complex(weight / I - (TOP["I3"] * part * critical / (2 * I)) ** 2)).real
        assert abs(found.eigenvalues[0].real - grows) < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("shape", [0.25, 0.5])  # I_1 / m r^2 of a uniform disk, and of a hoop
def test_the_slowest_speed_of_an_upright_disk(shape):
    m, r, g = 2.0, 0.5, 9.81
    I1, I3 = shape * m * r * r, 2 * shape * m * r * r
    least = np.sqrt(I1 * m * g * r / (I3 * (I3 + m * r * r)))
    assert abs((least * r) ** 2 / (g * r) - {0.25: 1 / 3, 0.5: 1 / 4}[shape]) < 1e-15
    squares = []
    for part, verdict in ((0.99, "unstable"), (1.01, "undecided")):
        scene = rolling_disk(
            np.pi / 2, precession=0.0, spin=part * least, m=m, radius=r, I1=I1, g=g
        )
        found = linearize_steady(scene)
        assert (found.symmetries, found.family) == (4, 2)
        assert found.reduced.verdict == verdict
        # I_1 (I_1 + m r^2) theta'' + (I_3 (I_3 + m r^2) n^2 - I_1 m g r) theta = 0
        square = I1 * m * g * r * (1 - part**2) / (I1 * (I1 + m * r * r))
        assert gap(np.sort(found.reduced.eigenvalues**2), np.full(2, square + 0j)) < 1e-9
        squares.append(np.mean(found.reduced.eigenvalues**2).real)
    # The squares are linear in that of the spin; the edge of stability is where they vanish.
    edge = np.sqrt(0.99**2 + (1.01**2 - 0.99**2) * squares[0] / (squares[0] - squares[1]))
    assert abs(edge - 1) < 1e-9


def _triangle(m) -> Scene:
    """Three bodies that turn as an equilateral triangle, at the rate 1 with side 1."""
    m = np.array(m) / np.sum(m)
    r = np.array([[0, 0], [1, 0], [0.5, np.sqrt(0.75)]])
    r = r - m @ r
    v = np.stack([-r[:, 1], r[:, 0]], axis=1)
    y0 = np.concatenate([r.ravel(), v.ravel()])
    return Scene(FreePoints(m, 2), (PairGravity(1.0),), y0=y0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("m", "verdict"), [((1, 0.02, 0.01), "undecided"), ((1, 1, 1), "unstable")]
)
def test_lagranges_triangle_by_the_formula_of_gascheau(m, verdict):
    found = linearize_steady(_triangle(m)).reduced
    assert found.verdict == verdict
    a, b, c = np.array(m) / np.sum(m)
    squares = np.roots([1.0, 1.0, 27 / 4 * (a * b + b * c + c * a)]).astype(complex)
    for root in np.sqrt(squares):
        for value in (root, -root):
            assert np.abs(found.eigenvalues - value).min() < 1e-9


@pytest.mark.slow
def test_a_skate_glides_straight_with_its_centre_of_mass_ahead():
    m, inertia, arm, speed = 1.0, 0.5, 0.3, 2.0
    rate = m * arm * speed / (inertia + m * arm * arm)
    for side, verdict in ((1, "stable"), (-1, "unstable")):
        scene = one_skate(m=m, inertia=inertia, at=(-side * arm, 0.0), speed=speed, spin=0.0)
        found = linearize_steady(scene)
        assert found.reduced.verdict == verdict
        assert gap(found.reduced.eigenvalues, [-side * rate + 0j]) < 1e-9


@pytest.mark.slow
def test_a_disk_round_a_circle_wobbles_as_it_does_when_simulated():
    steady = precession.rolling_disk_circle(1.2, -1.0, m=1.0, radius=0.5, I1=1 / 16)
    scene = rolling_disk(1.2, precession=steady.precession, spin=steady.spin)
    (frequency,) = linearize_steady(scene).frequencies
    off = rolling_disk(1.2, precession=steady.precession, lean_rate=1e-6, spin=steady.spin)
    motion = simulate(off, 4 * np.pi / frequency, samples=41, rtol=1e-13)
    theta = np.asarray(motion["theta"]) - 1.2
    angle = frequency * np.asarray(motion.ts)
    parts = np.stack([np.ones(41), np.cos(angle), np.sin(angle)], axis=1)
    left = theta - parts @ np.linalg.lstsq(parts, theta)[0]
    assert np.abs(left).max() < 1e-5 * np.abs(theta).max()
    worse = np.stack([np.ones(41), np.cos(1.001 * angle), np.sin(1.001 * angle)], axis=1)
    assert np.ptp(theta - worse @ np.linalg.lstsq(worse, theta)[0]) > 1e-4 * np.abs(theta).max()


class Push(Effect):
    """A force k r away from the origin [N]."""

    velocity_dependent = False

    def force(self, t, r, v, m):
        return 1.0 * r


def test_what_is_not_steady_is_refused():
    with pytest.raises(
        ValueError, match=r"^y: expected a state on a steady motion, got a rate off the symm"
    ):
        linearize_steady(top(0.5, spin=20.0, **TOP))
    # y(t) = exp(t) y(0) keeps its shape, but grows.
    growing = Scene(FreePoints([1.0], 1), (Push(),), y0=[1.0, 1.0])
    with pytest.raises(
        ValueError, match=r"^y: expected a state on a steady motion, got one that gro"
    ):
        linearize_steady(growing)
    drifting = Scene(FreePoints([1.0], 1), (), y0=[0.0, 1.0])
    with pytest.raises(
        ValueError, match=r"^y: expected a steady motion with others nearby, got none"
    ):
        linearize_steady(drifting)
    many = Scene(FreePoints(jnp.ones(11), 2), (), y0=np.arange(44.0))
    with pytest.raises(ValueError, match=r"^y: expected at most 40 entries, got 44\."):
        linearize_steady(many)
    with jax.enable_x64(False), pytest.raises(ValueError, match=r"^floats: expected 64-bit floats"):
        linearize_steady(drifting)
