"""All zeros in a box, proved: against closed forms, and left open where they cannot be proved."""

import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

import jaxdyn
from jaxdyn import equilibria, scenes
from jaxdyn._numerics import safe_norm
from jaxdyn.scenes.springs import two_springs


def _proof(rate, low, high):
    scene = jaxdyn.ode(lambda t, y: rate(y), np.ones(len(low)), 1.0)
    found = equilibria(scene, low, high, starts=64, prove=True).proof
    assert found is not None
    return found


def _holds(enclosed, exact) -> bool:
    with mpmath.workdps(60):
        return abs(mpmath.mpf(enclosed.mid) - exact) <= mpmath.mpf(enclosed.rad)


def test_the_zeros_of_a_cubic_and_a_line_are_all_found():
    proof = _proof(lambda y: [y[0] ** 3 - 2 * y[0] + y[1], y[1] - 0.5 * y[0]], [-3, -3], [3, 2.9])
    assert (proof.proved, len(proof.points), proof.undecided) == (True, 3, ())
    with mpmath.workdps(60):
        exact = [-mpmath.sqrt(1.5), mpmath.mpf(0), mpmath.sqrt(1.5)]
    points = sorted(proof.points, key=lambda point: float(point[0].mid))
    for point, x in zip(points, exact, strict=True):
        with mpmath.workdps(60):
            assert _holds(point[0], x)
            assert _holds(point[1], x / 2)
        assert float(point[0].rad) < 1e-40


def test_a_box_without_zeros_is_proved_to_have_none():
    proof = _proof(lambda y: [y[0] ** 2 + y[1] ** 2 + 0.01, y[1]], [-3, -3], [3, 3])
    assert (proof.proved, proof.points) == (True, ())
    assert "exactly 0 equilibria" in repr(proof)


def test_a_double_zero_is_left_undecided_and_named():
    proof = _proof(lambda y: [(y[0] - 1) ** 2, y[1] - y[0]], [-3, -3], [3, 3])
    assert not proof.proved
    assert all(abs(float(box[0].mid) - 1) < 1e-4 for box in proof.undecided)
    assert "could not be decided, near 1" in proof.reason
    assert proof.as_json()["undecided"][0][0].keys() == {"mid", "rad"}


@pytest.mark.sample("scene3-low3-high3-3")
@pytest.mark.parametrize(
    ("scene", "low", "high", "count"),
    [
        (scenes.pendulum(), [-0.5], [3.5], 2),
        (scenes.double_pendulum(), [-0.5, -0.6], [3.5, 3.6], 4),
        (scenes.henon_heiles(), [-1.1, -1.2], [1.3, 1.4], 4),
        (scenes.lorenz(), [-20, -21, -1], [22, 23, 60], 3),
        (scenes.bead_on_parabola(), [-2.1], [2.3], 1),
        (scenes.bead_on_cycloid(), [-0.51], [0.53], 1),
        (scenes.hanging_spring(), [-3.01, -3, -4.1], [3, 3.02, 4], 1),
    ],
)
def test_lists_of_scenes_are_proved_complete(scene, low, high, count):
    found = equilibria(scene, low, high, starts=64, prove=True)
    assert found.proof is not None
    assert found.proof.proved
    assert len(found) == len(found.proof.points)
    assert len(found) == count


@pytest.mark.slow
def test_two_springs_have_exactly_five_equilibria_and_none_at_their_anchors():
    proof = equilibria(two_springs(g=0.0), [-3.1, -3], [3, 3.2], starts=64, prove=True).proof
    assert proof is not None
    assert (proof.proved, len(proof.points), proof.undecided) == (True, 5, ())
    # At the anchors a spring has no length, and its force no direction.
    assert "a length is 0" in proof.reason
    with mpmath.workdps(60):
        up = max(proof.points, key=lambda point: float(point[1].mid))
        assert _holds(up[1], mpmath.sqrt(1.25))


def _push(y, strength, *, guarded):
    """A pull (1/2, 0), and a push of this strength towards the point (1, 0)."""
    a = y - jnp.array([1.0, 0.0])
    length = safe_norm(a) if guarded else jnp.sqrt(a[0] ** 2 + a[1] ** 2)
    return jnp.array([0.5, 0.0]) - strength * a / (
        jnp.where(length == 0, 1.0, length) if guarded else length
    )


@pytest.mark.sample("0.4-False")
@pytest.mark.parametrize("guarded", [True, False])
@pytest.mark.parametrize("strength", [0.25, 0.4])
def test_a_force_of_one_size_and_any_direction_has_no_zero(guarded, strength):
    proof = _proof(lambda y: _push(y, strength, guarded=guarded), [-3, -3], [3.1, 3.2])
    assert (proof.proved, proof.points) == (True, ())


@pytest.mark.slow
def test_a_force_that_has_a_direction_in_which_it_is_0_is_not_excluded():
    # 0 all along a ray from the point.
    proof = _proof(lambda y: _push(y, 0.5, guarded=True), [0.5, -0.5], [1.5, 0.6])
    assert not proof.proved


def test_a_corner_at_which_the_rate_is_0_by_its_own_case_is_not_excluded():
    def rate(y):
        length = safe_norm(y)
        return y / jnp.where(length == 0, 1.0, length)

    proof = _proof(rate, [-1, -1.1], [1.2, 1.3])
    assert not proof.proved
    assert all(abs(float(x.mid)) < 1e-4 for box in proof.undecided for x in box[:2])


def test_a_corner_at_which_an_infinity_may_cancel_is_not_excluded():
    # 0 in floats at the point itself, as one over infinity.
    proof = _proof(lambda y: [1 / (1 + 1 / jnp.sqrt(y[0] * y[0]))], [-1.1], [1.3])
    assert not proof.proved
    assert all(abs(float(box[0].mid)) < 1e-4 for box in proof.undecided)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("strength", "proved"), [(0.4, True), pytest.param(0.5, False, marks=pytest.mark.slow)]
)
def test_directions_in_space_and_on_a_line(strength, proved):
    def rate(y):
        a, b = y[:3], y[3:]
        across, along = jnp.sqrt(a @ a), jnp.sqrt(b @ b)
        pull = jnp.array([0.3, 0.0, 0.4]) - strength * a / across
        return jnp.concatenate([pull, 2 - b / along])

    low, high = [-0.011, -0.012, -0.013, 0.5], [0.01, 0.011, 0.012, 0.6]
    assert _proof(rate, low, high).proved  # the last entry alone is never 0
    other = lambda y: rate(jnp.append(y, 1.0))[:3]  # noqa: E731
    assert _proof(other, low[:3], high[:3]).proved is proved


def test_what_has_no_formulas_or_has_constraints_is_refused():
    with pytest.raises(ValueError, match="floor"):
        _proof(lambda y: [y[0] - jnp.floor(y[1]) * 0.5, y[1]], [-1, -1], [1, 1])
    with pytest.raises(ValueError, match="constraints, for a proof"):
        equilibria(scenes.free_body(), -np.ones(13), np.ones(13), starts=4, prove=True)
