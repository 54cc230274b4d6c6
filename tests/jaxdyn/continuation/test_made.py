"""Functions that make scenes are compiled with the numbers they captured, and anew for new ones."""

import pytest

import jaxdyn
from jaxdyn import continue_equilibria

LEVEL = 1.0


def make(mu):
    return jaxdyn.ode(lambda t, y, p: [p - LEVEL * y[0]], [0.0], 1.0, params=mu)


def test_a_captured_number_that_has_changed_is_not_stale(monkeypatch):
    first = continue_equilibria(make, 1.0, [1.0], members=2)
    assert first.members[0].x[0] == pytest.approx(1.0, rel=1e-12)
    monkeypatch.setitem(globals(), "LEVEL", 4.0)
    second = continue_equilibria(make, 1.0, [0.25], members=2)
    assert second.members[0].x[0] == pytest.approx(0.25, rel=1e-12)
    # What was made before goes on with the scenes of before, or not at all.
    expected = "make: expected the values it captured when what is continued was made, got others"
    with pytest.raises(ValueError, match=f"^{expected}"):
        continue_equilibria(first.make, 1.0, [1.0], members=2)
    assert continue_equilibria(second.make, 1.0, [0.25], members=2).members[0].x[0] == 0.25
