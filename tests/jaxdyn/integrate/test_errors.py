"""Differences of states, on which error estimates are based."""

import numpy as np

from jaxdyn import scenes
from jaxdyn.integrate.errors import gaps


def test_quaternions_of_opposite_sign_are_one_attitude():
    body = scenes.free_body()
    names = [name for name, _ in body.labels()]
    q = [names.index(name) for name in ("qw", "qx", "qy", "qz")]
    near = np.array(body.y0)
    near[q] = [0.5, -0.3, 0.4, np.sqrt(0.5)]
    far = near.copy()
    far[q] += [1e-9, 0.0, 0.0, -1e-10]
    there = far - near
    far[q] *= -1
    found = gaps(body, np.array([far]), np.array([near]))[0]
    np.testing.assert_allclose(np.abs(found), np.abs(there), atol=1e-16)


def test_angles_are_compared_modulo_a_turn_and_small_differences_exactly():
    pendulum = scenes.pendulum()
    ys = np.array([[7.0, 3.0], [1.0 + 1e-15, 2.0], [0.1, 9.0]])
    others = np.array([[7.0 - 2 * np.pi, 3.0], [1.0, 2.0], [0.1 + 1e-3, 2.0]])
    found = gaps(pendulum, ys, others)
    np.testing.assert_allclose(found[0], 0.0, atol=4e-15)
    np.testing.assert_array_equal(found[1:], ys[1:] - others[1:])
