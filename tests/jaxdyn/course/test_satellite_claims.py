"""The claims of problem 57 against closed forms."""

import mpmath
import numpy as np
import pytest

from jaxdyn.course.satellite_claims import satellite_claims
from jaxdyn.geometry.inertia import principal
from jaxdyn.scenes.satellites import SATELLITES


@pytest.mark.slow
def test_the_claims_of_problem_57():
    claims = {claim.name: claim for claim in satellite_claims()}
    assert [name for name, claim in claims.items() if not claim.holds] == ["A ii", "A iii d"]
    a, b = (principal(SATELLITES[name]()).moments for name in "AB")
    np.testing.assert_allclose(claims["A i"].figure, np.diff(a).min() / a[2], rtol=1e-12)
    # Landau and Lifshitz, Mechanics, section 37: omega_2 is sn, here from its largest on.
    H2 = (np.cos(0.15) * a[1]) ** 2 + (np.sin(0.15) * a[2]) ** 2
    T2 = np.cos(0.15) ** 2 * a[1] + np.sin(0.15) ** 2 * a[2]
    rate = np.sqrt((a[2] - a[1]) * (H2 - T2 * a[0]) / np.prod(a))
    k2 = (a[1] - a[0]) * (T2 * a[2] - H2) / ((a[2] - a[1]) * (H2 - T2 * a[0]))
    half = 2 * float(mpmath.ellipk(float(k2))) / rate
    assert claims["A iii c"].figure == round(60.0 / half)
    assert claims["B i"].figure == abs(b[1] - b[0]) / b[2]
