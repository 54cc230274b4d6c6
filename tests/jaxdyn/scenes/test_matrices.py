"""Linear systems given by matrices, against SciPy and against rows of masses."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from helpers import EXACT, SOLVED, gap

import jaxdyn
import orbits
from jaxdyn import scenes, vibration
from jaxdyn.analysis import energy

M = np.array([[2.0, 0.3, 0.0], [0.3, 1.0, -0.2], [0.0, -0.2, 0.5]])
K = np.array([[50.0, -10.0, 0.0], [-10.0, 30.0, -5.0], [0.0, -5.0, 20.0]])
C = 0.1 * M + 0.01 * K
GYROSCOPIC = np.array([[0.0, 0.4, 0.0], [-0.4, 0.0, 0.1], [0.0, -0.1, 0.0]])


def test_modes_of_matrices_against_scipy():
    found = vibration.modes(scenes.linear_system(M=M, K=K))
    squares, shapes = scipy.linalg.eigh(K, M)
    assert gap(found.frequencies, np.sqrt(squares)) < 10 * EXACT
    largest = shapes[np.abs(shapes).argmax(axis=0), range(3)]
    assert gap(found.shapes, shapes / largest) < 100 * EXACT
    damped = vibration.modes(scenes.linear_system(M=M, C=C, K=K))  # proportional damping
    assert (
        gap(damped.damping_ratios, (0.1 / np.sqrt(squares) + 0.01 * np.sqrt(squares)) / 2) < 1e-14
    )
    for matrix, given in ((damped.mass, M), (damped.damping, C), (damped.stiffness, K)):
        assert gap(matrix, given) < 100 * EXACT


def test_gyroscopic_and_circulatory_terms_against_scipy():
    stiffness = K + 3 * GYROSCOPIC
    scene = scenes.linear_system(M=M, C=C + GYROSCOPIC, K=stiffness, names=("a", "b", "c"))
    omega = np.array([1.0, 5.0, 9.0])
    found = vibration.receptance(scene, "a", "c", omega)
    dynamic = [K + 3 * GYROSCOPIC - w**2 * M + 1j * w * (C + GYROSCOPIC) for w in omega]
    assert gap(found, [np.linalg.inv(d)[2, 0] for d in dynamic]) < EXACT
    poles = scipy.linalg.eigvals(
        np.block([[np.zeros((3, 3)), np.eye(3)], [-stiffness, -C - GYROSCOPIC]]),
        scipy.linalg.block_diag(np.eye(3), M),
    )
    ours = np.asarray(vibration.transfer_function(scene, "a", "c").poles)
    apart = np.abs(ours[:, None] - poles)
    assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 100 * EXACT
    turning = jaxdyn.simulate(scenes.linear_system(M=M, C=GYROSCOPIC, K=K, x=[1, 0, 0]), rtol=1e-13)
    assert energy.drift(turning) < SOLVED  # gyroscopic forces do no work


def test_a_motion_is_that_of_the_matrix_exponential():
    x, v = (1.0, 0.0, -0.5), 0.2
    scene = scenes.linear_system(M=M, C=C, K=K, x=x, v=v)
    inverse = np.linalg.inv(M)
    a = np.block([[np.zeros((3, 3)), np.eye(3)], [-inverse @ K, -inverse @ C]])
    known = scipy.linalg.expm(2.0 * a) @ [*x, v, v, v]
    assert gap(jaxdyn.solve(scene, 2.0, rtol=1e-13).y1, known) < SOLVED


@pytest.mark.slow
def test_matrices_of_a_row_of_masses_give_its_response():
    row = scenes.spring_chain(m=(2.0, 1.0), k=(30.0, 10.0), c=(0.3, 0.1))
    found = vibration.modes(row)
    scene = scenes.linear_system(M=found.mass, C=found.damping, K=found.stiffness)
    curve = orbits.frequency_response(scene, "x1", (2.0, 3.0), step=0.5).to_pandas()
    known = np.abs(vibration.receptance(row, "x1", "x1", curve["frequency"].to_numpy()))
    assert gap(curve["amplitude"], known) < 1e-8


def test_equations_name_the_entries_of_matrices():
    found = str(jaxdyn.equations(scenes.linear_system(M=M[:2, :2], C=C[:2, :2], K=K[:2, :2])))
    assert "M11 x1'' + M12 x2'' + K11 x1 + K12 x2 = -C11 x1' - C12 x2'" in found


def test_numbers_of_matrices_are_traced():
    def size(k):
        scene = scenes.linear_system(K=jnp.array([[k, -1.0], [-1.0, 2.0]]))
        return jnp.real(vibration.receptance(scene, "x1", "x1", 0.3))

    # the derivative of an inverse: the row and the column of that entry
    assert gap(jax.jit(jax.grad(size))(2.0), -(size(2.0) ** 2)) < EXACT


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"M": [[1, 2], [2, 1]]}, r"M: expected a positive definite .* eigenvalues \[-1"),
        ({"M": [[1, 0], [0.1, 1]]}, "M: expected a symmetric matrix"),
        ({"M": [1, 2]}, r"M: expected shape \(any, any\)"),
        ({"M": np.eye(3)}, r"K: expected shape \(3, 3\), got shape \(2, 2\)"),
        ({"C": [[1.0]]}, r"C: expected shape \(2, 2\)"),
        ({"x": [1.0]}, r"x: expected shape \(2,\)"),
        ({"names": ["a"]}, "names: expected 2, got 1"),
        ({"K": [[np.nan, 0], [0, 1]]}, "K: expected"),
    ],
)
def test_what_is_no_such_matrix_is_refused(given, said):
    with pytest.raises(ValueError, match=said):
        scenes.linear_system(**given).check()


def test_modes_of_bare_matrices_name_the_scene():
    for first in (M, M.tolist(), jnp.asarray(M)):
        with pytest.raises(ValueError, match=r"scene: .*scenes\.linear_system\(M=M, C=C, K=K\)"):
            vibration.modes(first, C, K)  # pyright: ignore[reportArgumentType]
