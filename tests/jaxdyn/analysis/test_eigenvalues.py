"""Eigenvalues of perturbed matrices lie within their bars; verdicts wait until bars settle them."""

import numpy as np
import pytest
from helpers import gap

from jaxdyn.analysis.eigenvalues import (
    ERROR_SAFETY,
    Eigenvalues,
    bound_by_product,
    eigenvalues,
    map_eigenvalues,
    map_verdict,
    pair_reciprocals,
    rate_eigenvalues,
    rate_verdict,
)


def _farthest(found: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """(k,) how far each eigenvalue is from the nearest exact one."""
    return np.abs(found[:, None] - exact[None]).min(axis=1)


@pytest.mark.parametrize("size", [1e-12, 1e-9, 1e-6])
def test_bars_cover_errors_of_the_size_that_is_stated(size):
    rng = np.random.default_rng(1)
    widest = 0.0
    for k in (2, 3, 6):
        jordan = np.eye(k) + np.diag(np.ones(k - 1), 1)
        exact_ones = np.ones(k)
        simple = np.diag(np.arange(1.0, k + 1))
        for form, exact in ((jordan, exact_ones), (simple, np.diag(simple))):
            s = rng.normal(size=(k, k)) + 2 * np.eye(k)
            a = s @ form @ np.linalg.inv(s)
            off = rng.normal(size=(k, k))
            off *= size / np.linalg.norm(off, 2)
            found = eigenvalues(a + off, size)
            wrong = _farthest(found.values, exact)
            assert (wrong < found.bars).all()
            widest = max(widest, (found.bars / wrong).min())
    assert widest > 1  # there were errors


def test_entries_of_an_error_give_narrower_bars_that_hold():
    rng = np.random.default_rng(4)
    narrower, n = [], 0
    for _ in range(200):
        # Two eigenvalues that nearly coincide, vectors that are nearly parallel.
        diagonal = np.array([1.0 + 1e-3, 1.0 - 1e-3, -0.5, 20.0])
        s = rng.normal(size=(4, 4))
        s[:, 1] = s[:, 0] + 1e-3 * s[:, 1]
        left = np.linalg.inv(s)
        a = s @ np.diag(diagonal) @ left
        # Errors that mostly shear along the pair, as those of an orbit do along its flow.
        changes = [s @ (1e-7 * rng.normal(size=(4, 4))) @ left for _ in range(2)]
        off = 0.1 * (rng.normal() * changes[0] + rng.normal() * changes[1])
        plain, better = (
            eigenvalues(a + off, np.linalg.norm(off, 2), known) for known in (None, changes)
        )
        wrong = _farthest(better.values, diagonal)
        assert (wrong < better.bars).all()
        assert (better.bars <= plain.bars).all()
        narrower.append((plain.bars / better.bars)[np.abs(better.values - 1) < 0.01])
        n += (wrong > 1e-3 * better.bars).sum()
    assert np.median(narrower) > 20
    assert n > 400  # bars are no wider than they have to be


def test_entries_of_an_error_that_mix_two_eigenvalues_decide_nothing():
    a = np.array([[1.0, 1.0], [0.0, 1.0 + 1e-4]])
    change = np.array([[0.0, 0.0], [1e-6, 0.0]])  # makes them 1 +- 1e-3
    found = eigenvalues(a, 1e-6, [change])
    np.testing.assert_array_equal(found.bars, eigenvalues(a, 1e-6).bars)
    moved = np.linalg.eigvals(a + change)
    assert (_farthest(found.values, moved) < found.bars).all()


def test_a_stack_is_its_matrices():
    rng = np.random.default_rng(2)
    stack = rng.normal(size=(2, 3, 4, 4))
    stack[1, 2] = np.diag(np.ones(3), 1)  # eigenvectors that are parallel
    errors = 10.0 ** -rng.integers(6, 12, size=(2, 3))
    changes = 1e-9 * rng.normal(size=(2, 2, 3, 4, 4))
    ways = (
        (eigenvalues, ()),
        (eigenvalues, (changes,)),
        (map_eigenvalues, (changes,)),
        (rate_eigenvalues, ()),
    )
    for of, known in ways:
        together = of(stack, errors, *known)
        for at in np.ndindex(2, 3):
            alone = of(stack[at], errors[at], *(x[:, *at] for x in known))
            assert gap(together.values[at], alone.values) < 1e-14
            np.testing.assert_allclose(together.bars[at], alone.bars, rtol=1e-6)
    assert np.isfinite(together.bars).all()


def test_order_is_that_of_what_grows_fastest():
    a = np.diag([-3.0, 1.0, 2.0])
    assert rate_eigenvalues(a).values.real.tolist() == [2, 1, -3]
    assert map_eigenvalues(a).values.real.tolist() == [-3, 2, 1]
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    assert map_eigenvalues(turn).values.imag.tolist() == [1, -1]


@pytest.mark.parametrize(
    ("values", "verdict"),
    [([-1.0, -0.2], "stable"), ([-1.0, 0.05], "undecided"), ([-1.0, 0.2], "unstable")],
)
def test_rates_within_their_bars_decide_nothing(values, verdict):
    found = Eigenvalues(np.array(values, complex), np.full(2, 0.1))
    assert str(rate_verdict(found)) == verdict


def test_eigenvalues_that_meet_have_wide_bars():
    error = 1e-12
    apart, bars = map_eigenvalues(np.diag([1.0, 2.0]), error)
    assert gap(apart, np.array([2.0 + 0j, 1.0])) == 0
    assert (bars < 2 * ERROR_SAFETY * error).all()
    block = np.array([[1.0, 1.0], [1e-14, 1.0]])
    values, bars = map_eigenvalues(block, error)
    assert gap(values, np.array([1 + 1e-7 + 0j, 1 - 1e-7])) < 1e-9
    # An error of 1e-12 in the corner moves them by 1e-6.
    assert (bars > 1e-6).all()
    assert (bars < 1e-5).all()


CIRCLE = np.exp(2j * np.pi * np.array([0.1, -0.1, 0.3, -0.3]))


@pytest.mark.parametrize(
    ("values", "bar", "conservative", "verdict"),
    [
        (CIRCLE, 1e-10, True, "stable"),
        (CIRCLE, 0.4, True, "undecided"),  # any two could have met
        (CIRCLE, 1e-10, False, "undecided"),  # on the circle nothing holds them there
        (0.9 * CIRCLE, 1e-10, False, "stable"),
        (0.9 * CIRCLE, 0.05, False, "undecided"),
        (1.1 * CIRCLE, 1e-10, False, "unstable"),
        (1.1 * CIRCLE, 0.05, False, "undecided"),
        (np.array([1 + 1e-6, 1 - 1e-6]), 1e-6, True, "undecided"),
        (np.array([1 + 1e-6, 1 - 1e-6]), 1e-8, True, "unstable"),
        (np.array([-1.0 + 0j, -1.0]), 1e-8, True, "undecided"),
        (
            np.exp(2j * np.pi * np.array([0.2, -0.2, 0.2 + 1e-10, -0.2 - 1e-10])),
            1e-9,
            True,
            "undecided",
        ),
        (np.zeros(0), 1e-10, True, "stable"),
    ],
)
def test_verdicts_keep_away_from_their_bars(values, bar, conservative, verdict):
    found = Eigenvalues(values, np.full(len(values), ERROR_SAFETY * bar))
    assert str(map_verdict(found, conservative)) == verdict


def test_bars_of_a_symplectic_map_are_at_least_what_its_pairs_miss():
    # A pair that is alone is on the circle, however narrow its bars are said to be.
    pair = (1 + 1e-8) * CIRCLE[:2]
    found = pair_reciprocals(Eigenvalues(pair, np.full(2, 1e-12)))
    assert (found.bars >= 0.99e-8).all()
    assert str(map_verdict(found, True)) == "stable"
    # One that has its images keeps its bars: real, or four complex ones.
    for values in (
        np.array([1e6, -1.2, -1 / 1.2, 1e-6]),
        1.5 ** np.array([1, 1, -1, -1]) * CIRCLE[[0, 1, 0, 1]],
    ):
        kept = pair_reciprocals(Eigenvalues(values.astype(complex), np.full(4, 1e-9)))
        np.testing.assert_array_equal(kept.bars, np.full(4, 1e-9))
        assert str(map_verdict(kept, True)) == "unstable"
    alone = pair_reciprocals(Eigenvalues(np.array([1.5, 1 / 1.6], complex), np.full(2, 1e-9)))
    assert (alone.bars > 0.02).all()
    assert len(pair_reciprocals(Eigenvalues(np.zeros(0, complex), np.zeros(0))).bars) == 0


def test_the_vaguest_eigenvalue_is_what_the_others_leave_of_the_product():
    exact = np.array([2e8, -3.0, 1e-9])
    vague = Eigenvalues(exact * [1, 1, 0] + [0, 0, 0.03 + 0j], np.array([2e3, 1e-5, 0.1]))
    found = bound_by_product(vague, np.log(-exact.prod()), 1e-6)
    np.testing.assert_array_equal(found.values[:2], vague.values[:2])
    assert abs(found.values[2] + exact[2]) < 1e-20  # with the sign of a positive product
    assert 1e-14 < found.bars[2] < 1e-13
    # Two that are vague leave one of their product open, and none is known without bars.
    for bars in ([1e9, 1e-5, 0.1], [2e3, 4.0, 0.1]):
        both = Eigenvalues(vague.values, np.array(bars))
        np.testing.assert_array_equal(bound_by_product(both, 0.0).bars, bars)
    sharp = Eigenvalues(np.array([2.0 + 0j, 0.5]), np.full(2, 1e-15))
    np.testing.assert_array_equal(bound_by_product(sharp, 0.0, 1e-9).bars, sharp.bars)
    assert len(bound_by_product(Eigenvalues(np.zeros(0, complex), np.zeros(0)), 0.0).values) == 0
