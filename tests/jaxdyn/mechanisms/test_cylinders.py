"""Rolling cylinders: what is refused; their motions are tested with `scenes.cylinders`."""

import pytest

from jaxdyn import simulate
from jaxdyn.scenes.cylinders import cylinder_on_cylinder, cylinder_on_ramp


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"d": 1.0}, r"d: expected from 0 to below the radius, got 1\.0"),
        ({"slope": 1.6}, r"slope: expected below 90 degrees, got 1\.6"),
        ({"mu": -0.1}, r"mu: expected >= 0, got -0\.1"),
        ({"m": 0.0}, r"mass: expected > 0, got 0\.0"),
        ({"inertia": -1.0}, r"inertia: expected > 0, got -1\.0"),
        ({"r": -1.0}, r"r: expected > 0, got -1\.0"),
    ],
)
def test_impossible_cylinders_are_refused(kwargs, message):
    with pytest.raises(ValueError, match=message):
        simulate(cylinder_on_ramp(**kwargs))


def test_an_impossible_support_is_refused():
    with pytest.raises(ValueError, match=r"fixed: expected > 0, got 0\.0"):
        simulate(cylinder_on_cylinder(fixed=0.0))
