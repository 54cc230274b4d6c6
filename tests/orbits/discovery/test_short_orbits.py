"""Short orbits of three equal bodies in the plane are found, and have their published names."""

import jax.numpy as jnp
import pytest

import orbits

pytestmark = pytest.mark.usefixtures("optimised")


@pytest.mark.slow
def test_short_orbits_of_the_plane_and_their_names():
    found = orbits.search_plane(192, longest=8.0)
    assert {"figure-eight", "butterfly I", "butterfly II"} <= set(found.names)
    # The eight has a neighbour with its word, which is no choreography.
    assert found.families() == len(found.found) == 4
    assert [f.label for f in found.found.finds[:2]] == ["ABab", "ABab"]
    eight, other = found.found.orbits()[:2]
    assert orbits.identify(eight).choreography
    assert not orbits.identify(other).choreography
    a, b, period = found.starts()[found.names.index("butterfly I")]
    assert (round(a, 5), round(b, 5)) == (0.30689, 0.12551)
    assert jnp.isfinite(period)
