"""orbits.sections.complete: the velocity that section coordinates and an energy leave open."""

import jax
import jax.numpy as jnp
import numpy as np
from helpers import EXACT, gap, refusal

import jaxdyn
from jaxdyn import Status, scenes
from jaxdyn.analysis.energy import energy
from jaxdyn.integrate.events import Reaches, When
from orbits.sections import complete

HENON = scenes.henon_heiles()
PLANE = Reaches(0, 0.0, 1)
MOON = scenes.restricted_three_body()


def by_hand(y, vy, e):
    """vx of Henon and Heiles's model at x = 0."""
    return np.sqrt(2 * e - vy**2 - y**2 + 2 * y**3 / 3)


def test_the_missing_velocity_is_that_of_the_closed_form():
    y, vy = np.array([-0.3, 0.0, 0.2]), np.array([0.1, -0.2, 0.3])
    found = complete(HENON, PLANE, {"y": y, "vy": vy}, energy=1 / 8)
    assert gap(found.y0s, np.stack([0 * y, y, by_hand(y, vy, 1 / 8), vy], -1)) < EXACT
    other = complete(HENON, PLANE, {"y": y, "vy": vy}, energy=1 / 8, sign=-1)
    assert gap(other.y0s[:, 2], -found.y0s[:, 2]) < EXACT
    falling = complete(HENON, Reaches(0, 0.0, -1), {"y": y, "vy": vy}, energy=1 / 8)
    assert gap(falling.y0s, other.y0s) == 0.0


def test_starts_outside_the_allowed_region_are_nan_with_a_status():
    found = complete(HENON, PLANE, {"y": [0.1, 0.9, 0.2], "vy": 0.0}, energy=[0.1, 0.1, 0.01])
    assert found.status.tolist() == [Status.OK, Status.FORBIDDEN, Status.FORBIDDEN]
    assert np.isnan(found.y0s[1:]).all()
    assert found.ok.tolist() == [True, False, False]
    assert "2 starts: No state with these section coordinates" in found.message


def test_a_velocity_coupled_to_others_has_two_solutions_of_unlike_size():
    arm = scenes.double_pendulum()
    given = {"theta2": 0.5, "theta2_dot": 0.8}
    both = [complete(arm, PLANE, given, energy=0.0, sign=sign).y0s[0] for sign in (1, -1)]
    assert float(both[0][2]) > 0 > float(both[1][2])
    assert abs(float(both[0][2] + both[1][2])) > 0.1
    for y in both:
        assert abs(float(energy(arm, 0.0, y))) < EXACT


def test_turning_axes_and_an_energy_that_is_no_polynomial_of_the_unknown():
    found = complete(MOON, Reaches(1, 0.0, 1), {"x": 0.5, "vx": 0.1}, energy=-1.6)
    assert abs(float(energy(MOON, 0.0, found.y0s[0])) + 1.6) < EXACT
    swing = scenes.pendulum(g=1.0)  # E = v^2 / 2 - cos(angle)
    found = complete(swing, Reaches(1, 0.1), {}, energy=-0.5, unknown="theta")
    assert abs(float(jnp.cos(found.y0s[0, 0])) - 0.505) < EXACT


def test_an_entry_without_influence_on_the_energy_is_not_completed():
    def drifting(t, y):
        return [y[1], -y[0], 1.0]

    def level(t, y):
        return 0.5 * (y[0] ** 2 + y[1] ** 2)

    scene = jaxdyn.ode(drifting, [1.0, 0.0, 0.0], 9.0, names=["x", "v", "z"], energy=level)
    found = complete(scene, PLANE, {"v": 1.0}, energy=0.7, unknown="z")
    assert found.status.tolist() == [Status.NOT_COMPLETED]
    assert "Choose a velocity" in found.message
    assert np.isnan(found.y0s).all()


def test_an_energy_of_another_kind_does_not_forbid_what_its_quadratic_part_does():
    # With v^2 = 1 + sqrt(2) there is a state; the expansion at v = 0 has a maximum below 1/2.
    def of_state(t, y):
        return (y[1] ** 2 - 1) ** 2 / 4 + y[0] ** 2 / 2

    def rate(t, y):
        return [y[1] * (y[1] ** 2 - 1), -y[0]]

    scene = jaxdyn.ode(rate, [0.1, 0.1], names=["x", "v"], energy=of_state)
    found = complete(scene, PLANE, {}, energy=0.5, unknown="v")
    assert found.status.tolist() == [Status.NOT_COMPLETED]


def test_derivatives_are_those_of_the_closed_form():
    def vx(y, e):
        return complete(HENON, PLANE, {"y": y, "vy": 0.1}, energy=e).y0s[0, 2]

    v = by_hand(0.2, 0.1, 0.125)
    for by in (jax.jacfwd, jax.jacrev):
        slopes = by(vx, argnums=(0, 1))(0.2, 0.125)
        assert gap(jnp.stack(slopes), np.array([(0.2**2 - 0.2) / v, 1 / v])) < EXACT


def test_misuse_is_refused():
    def call(given, energy=0.1, event=PLANE, scene=HENON, **more):
        return refusal(lambda: complete(scene, event, given, energy=energy, **more))

    assert "given: expected also vy, got y" in call({"y": 0.1})
    assert "It is the unknown" in call({"y": 0.1, "vx": 0.0, "vy": 0.0})
    assert "Did you mean 'vy'" in call({"y": 0.1, "vyy": 0.0})
    assert "value 0.2 at start 0" in call({"x": 0.2, "y": 0.1, "vy": 0.0})
    assert "sign: expected 1 or -1, got 0" in call({"y": 0.1, "vy": 0.0}, sign=0)
    assert "unknown: expected the name of one" in call({}, event=When(_some))
    assert "Ravel them" in call({"y": np.zeros((2, 2)), "vy": 0.0})
    assert "energy: expected finite numbers" in call({"y": 0.1, "vy": 0.0}, energy=np.nan)
    assert "scene: expected one with an energy" in call(
        {"x": 0.0, "y": 1.0}, scene=scenes.lorenz(), event=Reaches(2, 27.0), unknown="z"
    ) or "given" in call({"x": 0.0, "y": 1.0}, scene=scenes.lorenz(), unknown="z")


def _some(t, y):
    return y[0] * y[1]
