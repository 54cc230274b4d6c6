"""Centres that a conserved energy shows to be stable, and those that it does not."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn import linearize, scenes

G, RADIUS = 9.81, 0.5


def energy(t, y):
    return 0.5 * (y[0] ** 2 + y[1] ** 2)


def bead(t, q, v, speed):
    """The Lagrangian of a bead on a hoop that turns about the vertical, per mass."""
    turning = 0.5 * (RADIUS * jnp.sin(q[0]) * speed) ** 2
    return 0.5 * (RADIUS * v[0]) ** 2 + turning + G * RADIUS * jnp.cos(q[0])


def hoop(speed):
    return jaxdyn.lagrangian(bead, [0.0], [0.0], 10.0, names=[("theta", "rad")], params=speed)


@pytest.mark.parametrize(
    ("rate", "of", "verdict"),
    [
        (lambda t, y: [y[1], -y[0]], energy, "stable"),
        (lambda t, y: [y[1], -y[0]], lambda t, y: -energy(t, y), "stable"),
        (lambda t, y: [y[1], -y[0]], None, "undecided"),
        # Along the motion the energy grows, decays, or depends on time.
        (lambda t, y: [y[1], -y[0] + y[1] ** 3], energy, "undecided"),
        (lambda t, y: [y[1], -y[0] - y[1] ** 3], energy, "undecided"),
        (lambda t, y: [y[1], -(1 + t) * y[0]], energy, "undecided"),
        # It is not flat there, or at no extremum.
        (lambda t, y: [y[1], -y[0]], lambda t, y: jnp.sqrt(1 + energy(t, y)) - 1, "stable"),
        (lambda t, y: [y[1], -y[0]], lambda t, y: energy(t, y) ** 2, "undecided"),
    ],
)
def test_an_energy_decides_only_if_it_is_conserved_and_has_an_extremum(rate, of, verdict):
    found = linearize(jaxdyn.ode(rate, [0.0, 0.0], 1.0, energy=of), [0.0, 0.0])
    assert (found.verdict, found.portrait) == (verdict, "centre")


def test_two_oscillators_of_opposite_energies_are_undecided():
    # Their linear motions are bounded, but coupled by cubic terms they may grow (Cherry, 1925).
    def rate(t, y):
        return [y[1], -4 * y[0], -y[3], y[2]]

    def both(t, y):
        return 0.5 * (4 * y[0] ** 2 + y[1] ** 2 - y[2] ** 2 - y[3] ** 2)

    assert linearize(jaxdyn.ode(rate, jnp.zeros(4), 1.0, energy=both), np.zeros(4)).verdict == (
        "undecided"
    )
    system = scenes.restricted_three_body(mu=0.01)
    l4 = [0.5 - 0.01, np.sqrt(0.75), 0.0, 0.0]
    assert (linearize(system, l4).verdict, linearize(system, l4).portrait) == (
        "undecided",
        "centre",
    )


def test_a_bead_on_a_hoop_is_stable_below_until_the_hoop_is_fast():
    family = jaxdyn.continue_equilibria(hoop, 2.0, [0.0, 0.0], within=(0.0, 10.0))
    (turn,) = family.special
    assert abs(turn.parameter - np.sqrt(G / RADIUS)) < 1e-12
    slow = family.parameters < turn.parameter
    verdicts = np.array([member.verdict for member in family.members])
    assert set(verdicts[slow]) == {"stable"}
    assert set(verdicts[~slow]) == {"unstable"}
    speed = 6.0
    side = np.arccos(G / RADIUS / speed**2)
    assert linearize(hoop(speed), [side, 0.0]).verdict == "stable"
    assert linearize(hoop(speed), [0.0, 0.0]).verdict == "unstable"
