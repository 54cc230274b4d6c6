"""Curves of special orbits in files: resumed after an interruption, loaded, refused."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
import orbits
from orbits import PLAIN, Kind, Orbit, Outcome

START = (1.25, 0.27)


def shaken(a, q):
    """A pendulum on a shaken pivot, damped."""

    def rate(t, y, c):
        return [y[1], -(c[0] - 2 * c[1] * jnp.cos(2 * t)) * jnp.sin(y[0]) - 0.01 * y[1]]

    return jaxdyn.ode(rate, [0.0, 0.0], np.pi, params=[a, q])


def follow(path=None, **options):
    rest = Orbit(shaken(*START).starting(jnp.zeros(2), np.pi), PLAIN, 0.0, Outcome.FOUND, 0, 1e-13)
    options = {"kind": Kind.DOUBLING, "members": 7, "path": path, **options}
    return orbits.continue_curve(shaken, rest, START, **options)


@pytest.fixture(scope="module")
def whole():
    return follow()


def interrupted(path, after):
    def report(point):
        seen.append(point)
        if len(seen) == after:
            raise KeyboardInterrupt

    seen = []
    with pytest.raises(KeyboardInterrupt):
        follow(path, report=report)


def assert_same(a, b):
    assert (a.end, a.before, len(a.special)) == (b.end, b.before, len(b.special))
    for one, two in zip(a.points, b.points, strict=True):
        np.testing.assert_array_equal(one.unknowns, two.unknowns)
        np.testing.assert_array_equal(one.tangent, two.tangent)
        np.testing.assert_array_equal(one.multipliers, two.multipliers)
        np.testing.assert_array_equal(one.orbit.y0, two.orbit.y0)
        assert (one.orbit.period, one.orbit.rtol) == (two.orbit.period, two.orbit.rtol)
        assert (one.orbit.residual, one.kind, one.tests) == (
            two.orbit.residual,
            two.kind,
            two.tests,
        )


@pytest.mark.slow
def test_an_interrupted_curve_goes_on_to_the_same_result(whole, tmp_path):
    path = tmp_path / "curve.jsonl"
    interrupted(path, 3)
    (part,) = orbits.curves.load(path, shaken)
    assert (len(part.members), part.end) == (3, "an interruption")
    assert_same(follow(path), whole)
    (found,) = orbits.curves.load(path, shaken)
    assert_same(found, whole)
    assert orbits.stability(found.members[-1].orbit).verdict in ("stable", "unstable", "undecided")
    figure = jaxdyn.drawing.bifurcation_curves([found], tmp_path / "curve.png")
    drawn = figure.axes[0].lines[0].get_xydata()  # a smooth curve through the members
    every = (len(drawn) - 1) // (len(whole.members) - 1)
    np.testing.assert_allclose(drawn[::every], whole.parameters, rtol=1e-12)


@pytest.mark.slow
def test_other_scenes_and_files_are_refused(whole, tmp_path):
    path = tmp_path / "curve.jsonl"
    follow(path, members=2)

    def stiffer(a, q):
        return shaken(1.1 * a, q)

    with pytest.raises(ValueError, match=r"make: expected the scenes of the file, got others, in"):
        orbits.curves.load(path, stiffer)
    with pytest.raises(ValueError, match="make: expected the scenes of the file"):
        orbits.curves.load(path, lambda a, q: jaxdyn.scenes.lorenz(rho=a))
    with pytest.raises(ValueError, match="path: expected a file of equilibria or orbits"):
        orbits.families.load(path, shaken)
    text = path.read_text()
    path.write_text(text.replace('"segments": 1', '"segments": 2'))
    with pytest.raises(ValueError, match="which is another or was edited"):
        orbits.curves.load(path, shaken)
