"""Pictures of response curves and backbones: what is solid, dashed, marked, and what is refused."""

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import jaxdyn
import orbits
from jaxdyn import drawing, scenes, vibration


def rate(t, y, damping):
    x, v = y
    return [v, -damping * v - x - 0.25 * x**3]


def duffing(damping):
    return jaxdyn.ode(rate, [0.0, 0.0], names=["x", "v"], params=damping)


@pytest.mark.slow
def test_response_curves_are_dashed_between_their_folds_and_the_backbone_passes_through():
    found = orbits.frequency_response(duffing(0.1), "x", (0.7, 2.5), levels=1.0)
    backbone = orbits.backbone(duffing(0.0), frequencies=(0.5, 2.4))
    upper, lower = orbits.drawing.frequency_response(found, backbone=backbone).axes[:2]
    lines = [line for line in upper.lines if len(line.get_xdata()) > 1]
    dashed = [line for line in lines if line.get_linestyle() == "--"]
    assert len(dashed) == 1
    ends = dashed[0].get_xdata()[[0, -1]]
    assert_allclose(ends, [fold.parameter for fold in found.folds[0]], rtol=1e-12)
    marks = [line.get_xdata()[0] for line in upper.lines if line.get_marker() == "s"]
    assert_allclose(marks, ends)
    (through,) = [line for line in lines if line.get_label() == "backbone"]
    a = np.interp(ends[0], through.get_xdata(), through.get_ydata())
    assert_allclose(a, dashed[0].get_ydata()[0], rtol=0.02)  # at resonance, with little damping
    assert upper.get_xlim() == (0.7, 2.5)
    assert all((0 <= line.get_ydata()).all() for line in lower.lines)
    assert max(line.get_ydata().max() for line in lower.lines) < np.pi

    again = orbits.drawing.frequency_response(found, backbone=backbone, hertz=True).axes[0]
    assert_allclose(again.get_xlim(), np.array([0.7, 2.5]) / (2 * np.pi))
    for line, other in zip(again.lines, upper.lines, strict=True):
        assert_allclose(line.get_xdata(), other.get_xdata() / (2 * np.pi), rtol=1e-12)
    vertical = [orbits.drawing.backbone(backbone, hertz=hertz).axes[0] for hertz in (True, False)]
    turns, angles = (ax.lines[0].get_xdata() for ax in vertical)
    assert_allclose(2 * np.pi * turns, angles, rtol=1e-12)
    for one in (found, backbone):
        table, other = one.to_pandas(hertz=True), one.to_pandas()
        assert_allclose(2 * np.pi * table["frequency"], other["frequency"], rtol=1e-14)

    def power(t, y):
        return y[1] ** 2

    label = orbits.drawing.frequency_response(found, output=power).axes[0].get_ylabel()
    assert label == "amplitude power"
    with pytest.raises(ValueError, match="output: expected"):
        orbits.drawing.frequency_response(found, output="z")
    picture = orbits.drawing.backbone(backbone).axes[0]  # it has no energy
    assert picture.get_xlabel() == "frequency"
    with pytest.raises(ValueError, match="against: expected amplitude"):
        orbits.drawing.backbone(backbone, against="energy")
    with pytest.raises(ValueError, match="against: expected one of"):
        orbits.drawing.backbone(backbone, against="time")


def test_a_bode_plot_of_a_narrow_range_has_a_linear_scale_of_frequencies():
    scales = []
    for high in (2.0, 20.0):
        omega = np.linspace(1.0, high, 50)
        scales.append(drawing.bode(omega, 1 / (2 - omega**2 + 0.1j)).axes[1].get_xscale())
    assert scales == ["linear", "log"]


def test_a_bode_plot_has_a_line_for_each_response(tmp_path):
    omega = jnp.geomspace(0.1, 10, 20)
    h = 1 / (1 - np.asarray(omega) ** 2 + 0.1j)
    figure = drawing.bode(omega, np.stack([h, 2 * h], 1), tmp_path / "bode.png", names=["a", "b"])
    magnitude, phase = figure.axes
    assert_allclose(magnitude.lines[1].get_ydata(), np.abs(2 * h))
    assert phase.lines[0].get_ydata()[-1] == pytest.approx(-180, abs=0.1)
    with pytest.raises(ValueError, match="omega: expected > 0"):
        drawing.bode(-omega, h)
    with pytest.raises(ValueError, match="names: expected 1"):
        drawing.bode(omega, h, names=["a", "b"])
    known = vibration.transfer_function(scenes.oscillator(k=4.0, x=0.0), "x", "x")
    named = drawing.bode(omega, known)
    assert named.axes[0].get_ylabel() == "x / force on x [m/N]"
    assert named.axes[1].get_xlabel() == "frequency [rad/s]"
    assert_allclose(named.axes[0].lines[0].get_ydata(), np.abs(1 / (4 - omega**2)), rtol=1e-12)
    own = drawing.bode(omega, known, magnitude="height", frequency="w")
    assert [own.axes[0].get_ylabel(), own.axes[1].get_xlabel()] == ["height", "w"]
    turns = drawing.bode(omega, known, hertz=True)
    assert turns.axes[1].get_xlabel() == "frequency [Hz]"
    assert_allclose(turns.axes[1].lines[0].get_xdata(), omega / (2 * np.pi), rtol=1e-15)
    few = drawing.bode(np.geomspace(1.0, 20.0, 200), np.ones(200))
    few.canvas.draw()
    labels = [tick.get_text() for tick in few.axes[1].get_xticklabels(which="both")]
    assert {"1", "2", "3", "5", "10", "20"} <= {*labels}
