"""Quantities of orbits: against closed forms, in other units, and what is refused."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import ellipk

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.analysis.energy import energy
from orbits.analysis import quantities
from orbits.analysis.quantities import amplitude, extremes, mean, phase, quantity
from orbits.discovery.libration import near_libration_point


@pytest.fixture(scope="module")
def driven():
    """x'' + 0.2 x' + x = cos(1.5 t + 0.3) + 2: x = 2 + Re(A e^(1.5 i t + 0.3 i))."""

    def rate(t, y):
        return [y[1], jnp.cos(1.5 * t + 0.3) + 2.0 - 0.2 * y[1] - y[0]]

    response = 1 / (1 - 1.5**2 + 0.3j)
    scene = jaxdyn.ode(rate, [2.0, 0.0], 2 * np.pi / 1.5, names=["x", "v"])
    return orbits.find(scene), response * np.exp(0.3j)


def test_a_driven_oscillator(driven):
    orbit, answer = driven
    size = abs(answer)
    assert np.allclose(extremes(orbit, "x"), [2 - size, 2 + size], rtol=0, atol=1e-12)
    assert abs(amplitude(orbit, "v") - 1.5 * size) < 1e-12
    assert abs(mean(orbit, "x") - 2.0) < 1e-12
    assert abs(mean(orbit, "v")) < 1e-12
    assert abs(phase(orbit, "x") + np.angle(answer)) < 1e-12


def test_an_extreme_at_the_start_counts():
    swing = orbits.find(scenes.pendulum(angle=2.0), period=8.3, hold="theta")
    low, high = extremes(swing, "theta")
    assert abs(high - 2.0) < 1e-12
    assert abs(low + 2.0) < 1e-12


def test_extremes_at_corners():
    """A capacitor that is charged to 3 for 0.7 of 2: extremes are where the voltage switches."""

    def rate(t, y):
        return [jnp.where(jnp.mod(t, 2.0) < 0.7, 3.0, 0.0) - y[0]]

    orbit = orbits.find(jaxdyn.ode(rate, [0.5], 2.0, names=["u"]))
    high = 3 * (1 - np.exp(-0.7)) / (1 - np.exp(-2.0))
    exact = [high * np.exp(-1.3), high]
    np.testing.assert_allclose(extremes(orbit, "u"), exact, rtol=1e-13)


def test_means_and_phases_where_forces_jump():
    """The filter u' = v(t) - u of a voltage v that is 3 for 0.7 of 2."""

    def voltage(t, y):
        return jnp.where(jnp.mod(t, 2.0) < 0.7, 3.0, 0.0)

    def rate(t, y):
        return [voltage(t, y) - y[0]]

    orbit = orbits.find(jaxdyn.ode(rate, [0.5], 2.0, names=["u"]))
    harmonic = (1 - np.exp(-0.7j * np.pi)) / (1j * np.pi)  # of the voltage
    assert abs(mean(orbit, "u") - 1.05) < 1e-12
    assert abs(phase(orbit, "u") + np.angle(harmonic / (1 + 1j * np.pi))) < 1e-12
    # The values of a function may jump as well.
    assert abs(mean(orbit, voltage) - 1.05) < 1e-11
    assert abs(phase(orbit, voltage) + np.angle(harmonic)) < 1e-11


@pytest.mark.slow
def test_means_and_phases_of_a_relay():
    """x' = -y, y' = sgn x in two parabolas: corners where the state crosses zero.

    For x from 1/2 at y = 0, x = (1 - t^2) / 2 up to t = 1, and y = t: a triangle of period 4.
    """

    def rate(t, y):
        return [-y[1], jnp.sign(y[0])]

    orbit = orbits.find(jaxdyn.ode(rate, [0.5, 0.0], 4.0, names=["x", "y"]), hold="x")
    assert abs(orbit.period - 4.0) < 1e-12
    assert max(abs(mean(orbit, "x")), abs(mean(orbit, "y"))) < 1e-12
    assert abs(phase(orbit, "x")) < 1e-12
    assert abs(phase(orbit, "y") - np.pi / 2) < 1e-12


def test_names_mean_the_functions(driven):
    orbit, _ = driven
    assert quantity("period")(orbit) == orbit.period
    assert quantity("max x")(orbit) == extremes(orbit, "x")[1]
    assert quantity("min x")(orbit) == extremes(orbit, "x")[0]
    assert quantity("phase x")(orbit) == phase(orbit, "x")
    assert quantity(lambda orbit: 3.0)(orbit) == 3.0
    swing = orbits.find(scenes.pendulum(angle=2.0), period=8.3, hold="theta")
    assert quantity("energy")(swing) == float(energy(swing.scene, 0.0, swing.y0))
    assert quantities.unit("amplitude theta", swing.scene) == "rad"
    assert quantities.unit("period", swing.scene) == "s"
    assert quantities.unit("period", orbit.scene) == "1"


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("x", "quantity: expected a function of an orbit, or a name: .* got 'x'. Of entries"),
        ("amplitude", "Of entries there are max NAME, min NAME, amplitude NAME, mean NAME"),
        (3, "quantity: expected a function of an orbit"),
        ("max y", "entry: expected one of v, x, got 'y'"),
        ("energy", "quantity: expected one of a scene without an energy, got energy"),
        ("jacobi", "scene: expected a restricted three-body scene"),
    ],
)
def test_what_is_refused(driven, what, message):
    with pytest.raises(ValueError, match=message):
        quantities.check_quantity(what, driven[0].scene)


@pytest.mark.slow
def test_a_family_of_one_period_is_drawn_by_an_amplitude():
    def make(force):
        return jaxdyn.ode(
            lambda t, y, f: [y[1], -4.0 * y[0] - 0.1 * y[1] + f * jnp.cos(t)],
            [0.1, 0.0], 2 * np.pi, params=force, names=["x", "v"]
        )  # fmt: skip

    family = orbits.continue_family(orbits.find(make(1.0)), make, 1.0, members=3)
    (ax,) = orbits.drawing.family(family).axes
    assert ax.get_ylabel() == "amplitude x"


def test_a_family_is_drawn_by_a_quantity():
    swing = orbits.find(scenes.pendulum(angle=1.0), period=2.0, hold="theta")
    family = orbits.continue_family(swing, members=2, step=0.1)
    (ax,) = orbits.drawing.family(family, quantity="amplitude theta").axes
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("energy [J]", "amplitude theta [rad]")
    (first,) = (line for line in ax.lines if line.get_label() == "first")
    assert abs(first.get_ydata()[0] - 1.0) < 1e-12
    (ax,) = orbits.drawing.family(family, quantity=lambda orbit: 2 * orbit.period).axes
    assert ax.get_ylabel() == "quantity"
    (first,) = (line for line in ax.lines if line.get_label() == "first")
    assert first.get_ydata()[0] == 2 * swing.period
    with pytest.raises(ValueError, match="entry: expected one of theta, theta_dot, got 'x'"):
        orbits.drawing.family(family, quantity="max x")
    with pytest.raises(ValueError, match="parameter: expected none for a family in energy"):
        orbits.drawing.family(family, parameter="period")
    with pytest.raises(ValueError, match="functions of different names, got quantity twice"):
        family.to_pandas(lambda orbit: 1.0, lambda orbit: 2.0)


def test_the_command_refuses_a_quantity_before_it_follows_the_family(command, tmp_path):
    words = ("family", "pendulum", "--period", "2.1", "--plot", str(tmp_path / "family.png"))
    code, out, err = command("orbits", *words, "--quantity", "max x")
    assert code == 2
    assert "entry: expected one of theta, theta_dot, got 'x'" in err
    assert out.count("period") < 20


@pytest.mark.slow
def test_the_jacobi_constant_and_the_multiplier_of_a_lyapunov_orbit():
    scene = scenes.restricted_three_body_in_space(system="earth-moon")
    guess = near_libration_point(scene, "lyapunov", "L1", amplitude=5e3)
    start, mirror = scene.starting(guess.y0), orbits.closing.mirror(scene)
    orbit = orbits.find(start, period=guess.period, closing=mirror, hold="x")
    mu, km, second = float(scene.system.mu), *np.asarray(scene.system.units)[[0, 3]]
    (x, y, z), v = np.split(np.asarray(orbit.y0) / np.repeat([km, second], 3), 2)
    apart = [np.linalg.norm([x + mu, y, z]), np.linalg.norm([x + mu - 1, y, z])]
    wanted = x**2 + y**2 + 2 * (1 - mu) / apart[0] + 2 * mu / apart[1] - v @ v
    assert quantity("jacobi")(orbit) == pytest.approx(wanted, rel=1e-13)
    # The index of the saddle is (l + 1 / l) / 2 for its multipliers l and 1 / l.
    largest = quantity("multiplier")(orbit)
    assert max(orbits.stability(orbit).indices) == pytest.approx((largest + 1 / largest) / 2)
    assert quantities.unit("jacobi", orbit.scene) == "1"


@pytest.mark.slow
def test_tables_of_families_have_columns_of_quantities():
    pytest.importorskip("pandas")
    swing = orbits.find(scenes.pendulum(angle=2.0), period=2.7, hold="theta")
    family = orbits.continue_family(swing, members=3)

    def widest_swing(orbit):
        return 2.0 * amplitude(orbit, "theta")

    frame = family.to_pandas("amplitude theta", widest_swing)
    period = 4.0 * ellipk(np.sin(0.5 * frame["amplitude theta"]) ** 2) / np.sqrt(9.81)
    assert np.allclose(frame["period"], period, rtol=1e-11, atol=0)
    assert (frame["widest swing"] == 2.0 * frame["amplitude theta"]).all()
    assert frame.attrs["units"]["amplitude theta"] == "rad"
    assert "widest swing" not in frame.attrs["units"]
    with pytest.raises(ValueError, match="entry: expected"):
        family.to_pandas("amplitude y")
    pytest.importorskip("xarray")
    data = family.to_xarray("amplitude theta")
    assert (data["amplitude theta"].values == frame["amplitude theta"]).all()
