"""No unit matters: sections, their starts and maps are the same in all units."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
import orbits
from jaxdyn.integrate.events import Reaches

#: Units of length, time and mass: small ones, and mixtures.
UNITS = [(1e-12, 1e-12, 1e-12), (1.496e11, 5e6, 1.989e30), (1e12, 1e-6, 1e-12)]
SAME = 1e-8


def terms(t, s, units):
    length, time, mass = units
    (x, y), (u, v) = s[:2] / length, s[2:] * (time / length)
    return (
        mass
        * (length / time) ** 2
        * jnp.stack([0.5 * (u**2 + v**2), 0.5 * (x**2 + y**2) + x**2 * y - y**3 / 3])
    )


def level(t, s, units):
    return jnp.sum(terms(t, s, units))


def rate(t, s, units):
    """The stars of Henon and Heiles."""
    length, time, _ = units
    x, y = s[:2] / length
    pull = jnp.stack([-x - 2 * x * y, -y - x**2 + y**2]) * (length / time**2)
    return jnp.concatenate([s[2:], pull])


def stars(units):
    length, time, _ = units
    names = ["x", "y", "vx", "vy"]
    y0 = np.array([0.0, 0.1, 0.4, 0.0]) * np.repeat([length, length / time], 2)
    return jaxdyn.ode(
        rate, y0, 10.0 * time, names=names, params=units, energy=level, second_order=True
    )


@pytest.mark.slow
@pytest.mark.parametrize("units", UNITS)
def test_a_section_and_its_map(units):
    length, time, mass = units
    found = []
    for each in ((1.0, 1.0, 1.0), units):
        scene, plane = stars(each), Reaches(0, 0.0, 1)
        unit = each[2] * (each[0] / each[1]) ** 2
        given = {"y": np.array([0.1, 0.2, 0.9]) * each[0], "vy": 0.0}
        starts = orbits.sections.complete(scene, plane, given, energy=0.1 * unit)
        table = orbits.section(scene, plane, starts, crossings=4)
        P = orbits.sections.poincare_map(scene, plane, energy=0.1 * unit)
        q = np.array([0.1 * each[0], 0.05 * each[0] / each[1]])
        found.append((starts, table, P, q))
    (here, table, P, q), (there, new, N, p) = found
    assert here.ok.tolist() == there.ok.tolist() == [True, True, False]
    assert there.message == here.message
    sizes = np.repeat([length, length / time], 2)
    np.testing.assert_allclose(np.asarray(there.y0s) / sizes, here.y0s, atol=1e-13)
    assert (new.names, N.names) == (table.names, P.names)
    assert new.counts.tolist() == table.counts.tolist()
    np.testing.assert_allclose(new.qp / sizes[[0, 2]], table.qp, atol=SAME)
    np.testing.assert_allclose(new.ts / time, table.ts, atol=SAME)
    assert np.nanmax(new.drift) < 1e-9
    np.testing.assert_allclose(np.asarray(N(p)) / sizes[[0, 2]], P(q), atol=SAME)
    # Not on the section, by a part of a length that is small.
    unit = mass * (length / time) ** 2
    off = {"x": 1e-3 * length, "y": 0.1 * length, "vy": 0.0}
    with pytest.raises(ValueError, match="starts on the section"):
        orbits.sections.complete(stars(units), Reaches(0, 0.0, 1), off, energy=0.1 * unit)
