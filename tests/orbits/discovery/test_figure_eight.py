"""The figure-eight and its neighbour, against numbers computed apart to 30 digits.

`references/figure_eight_reference.py` made the numbers, with another integrator (Taylor series,
extended precision), another normal form of the unknowns, and none of this package.
"""

import json

import jax.numpy as jnp
import matplotlib.image
import numpy as np
import pytest
from helpers import SOLVED, TESTS, gap

import orbits
from jaxdyn import scenes, simulate
from orbits.discovery.figure_eight import BOX, PERIOD_BOX, figure_eight

_FILE = TESTS / "references" / "figure_eight_reference.json"
REFERENCE = json.loads(_FILE.read_text())["orbits"]
EIGHT, NEIGHBOUR = REFERENCE["figure_eight"], REFERENCE["neighbour"]
#: Multipliers come from eigenvalues of a 12 x 12 matrix with entries up to a thousand.
MULTIPLIERS = 1e-10


@pytest.fixture(scope="module")
def found():
    return figure_eight()


@pytest.fixture(scope="module")
def neighbour(found):
    return found[0]


@pytest.fixture(scope="module")
def eight(found):
    return found[1]


def numbers(texts) -> np.ndarray:
    return np.array([float(text) for text in texts])


@pytest.mark.slow
def test_plain_closing_ends_on_the_neighbour(neighbour):
    assert neighbour.ok
    assert neighbour.closing == orbits.PLAIN
    what = orbits.identify(neighbour)
    assert abs(what.scale_free - float(NEIGHBOUR["scale_free_period"])) < 1e-11
    assert not what.choreography
    # By the reference 0.06 in another scale: no rounding.
    assert what.permutation_error > 0.01
    assert abs(what.angular_momentum) < SOLVED


def test_the_choreography_is_montgomerys_eight(eight):
    assert eight.ok
    assert eight.closing.parts == 3
    what = orbits.identify(eight)
    assert abs(what.scale_free - float(EIGHT["scale_free_period"])) < SOLVED
    assert what.choreography
    assert what.permutation_error < SOLVED
    assert abs(what.angular_momentum) < SOLVED


def test_the_two_differ_by_what_a_loose_closure_cannot_see(found):
    plain, eight = (orbits.identify(orbit).scale_free for orbit in found)
    assert 1.4e-6 < plain - eight < 1.6e-6


@pytest.mark.parametrize("which", [0, 1], ids=["neighbour", "eight"])
def test_they_close(found, which):
    orbit = found[which]
    assert orbits.analysis.closure(orbit) <= 1e-13
    second = orbits.recheck(orbit)
    assert second.closure <= 1e-12
    assert second.solver == "Verner 9(8)"
    assert second.tolerance < orbit.rtol
    assert orbits.analysis.closure(orbit, periods=5) <= 1e-10


def test_multipliers_of_the_neighbour(neighbour):
    result = orbits.stability(neighbour)
    real, circle = NEIGHBOUR["pairs"]
    pair = numbers([real["lambda"], real["one_over_lambda"]])
    moduli = result.nontrivial[np.abs(result.nontrivial.imag) < 1e-6]
    assert gap(np.sort(moduli.real)[::-1], pair) < MULTIPLIERS
    assert result.exponents[0] is None
    assert abs(result.exponents[1] - float(circle["nu"])) < MULTIPLIERS
    assert (result.verdict, result.unit) == ("unstable", 8)


def test_the_picture_of_the_readme_is_what_is_drawn(neighbour, eight, tmp_path):
    pytest.importorskip("matplotlib", minversion="3.11", reason="older ones lay out text otherwise")
    titles = ["closed plainly", "closed as a choreography"]
    orbits.drawing.orbits([neighbour, eight], tmp_path / "eight.png", titles)
    drawn = matplotlib.image.imread(tmp_path / "eight.png")
    shown = matplotlib.image.imread(TESTS.parent / ".pictures" / "figure-eight.png")
    assert drawn.shape == shown.shape
    # Edges of letters and lines depend on the version of the library that draws.
    assert np.mean(np.abs(drawn - shown)) < 0.01


def test_multipliers_of_the_eight(eight):
    result = orbits.stability(eight)
    nu = numbers([pair["nu"] for pair in EIGHT["pairs"]])
    assert gap(np.array(result.exponents), nu) < MULTIPLIERS
    assert (result.verdict, result.unit) == ("stable", 8)
    assert np.max(np.abs(np.abs(result.nontrivial) - 1)) < MULTIPLIERS


@pytest.mark.parametrize("which", [0, 1], ids=["neighbour", "eight"])
def test_the_unit_block_is_complete_and_the_matrix_symplectic(found, which):
    orbit = found[which]
    result = orbits.stability(orbit)
    assert set(result.reasons) == {
        *("energy", "momentum x", "momentum y", "angular momentum"),
        *("flow", "shift along x", "shift along y", "turn in xy"),
    }
    assert len(result.multipliers) == 12
    assert len(result.nontrivial) == len(result.bars) == 4
    # None of the others is so near to 1 that it could belong to the block.
    assert (np.abs(result.nontrivial - 1) > 1e3 * result.bars).all()
    assert (result.multipliers[4:] == 1).all()
    assert result.symplectic_defect < SOLVED
    assert result.determinant_defect < 1e-9  # a product of 12, of condition |M|^2 = 1e5
    # The error bars hold, and are no wider than the accuracy they stand for.
    assert (result.bars < MULTIPLIERS).all()
    traces = numbers(
        [pair["trace"] for pair in REFERENCE[("neighbour", "figure_eight")[which]]["pairs"]]
    )
    assert abs(np.sum(result.nontrivial) - np.sum(traces)) < np.sum(result.bars)


@pytest.mark.parametrize("which", [0, 1], ids=["neighbour", "eight"])
def test_normal_form_is_the_reference(found, which):
    form = orbits.normal_form(found[which])
    reference = (NEIGHBOUR, EIGHT)[which]
    assert abs(form.period - float(reference["period"])) < SOLVED
    y0 = numbers(reference["y0"])
    # The printed start of problem 17 runs through the same curve the other way.
    y0[6:] *= -1
    assert gap(form.y0, y0) < SOLVED
    assert orbits.analysis.closure(form) < SOLVED


def test_normal_form_of_a_normal_form_is_itself(eight):
    once = orbits.normal_form(eight)
    twice = orbits.normal_form(once)
    assert gap(once.y0, twice.y0) < SOLVED
    assert abs(once.period - twice.period) < SOLVED


def test_normal_form_forgets_frame_phase_scale_labels_and_units(eight):
    # Relabelled, mirrored and turned, larger, heavier, elsewhere, a seventh of a period later.
    form = orbits.normal_form(eight)
    scale, m, gravity, angle = 1.7, 2.5, 0.6, 0.8
    later = simulate(form.scene, samples=jnp.array([form.period / 7]), rtol=1e-14)
    ring, _ = orbits.choreography(3)
    r, v = np.asarray(ring.symmetry.act(later.ys[0])).reshape(2, 3, 2)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [s, -c]])
    slow = scale**1.5 / np.sqrt(m * gravity)
    y0 = np.concatenate([scale * r @ turn + [[0.3, -0.2]], scale / slow * v @ turn]).ravel()
    scene = scenes.three_body(y0, m=[m] * 3, G=gravity, t1=slow * form.period)
    copy = orbits.find(scene, closing=orbits.choreography(3))
    assert abs(copy.period - slow * form.period) < SOLVED * slow
    back = orbits.normal_form(copy)
    assert abs(back.period - form.period) < SOLVED
    assert gap(back.y0, form.y0) < SOLVED


def test_the_printed_start_of_problem_17_is_the_same_orbit(eight):
    printed = orbits.find(scenes.three_body(), closing=orbits.choreography(3))
    assert abs(printed.period - scenes.EIGHT_PERIOD) < 1e-6  # eight printed digits
    assert gap(printed.y0, jnp.asarray(scenes.EIGHT)) < 1e-6
    a, b = orbits.normal_form(printed), orbits.normal_form(eight)
    assert abs(a.period - b.period) < SOLVED
    assert gap(a.y0, b.y0) < SOLVED


def test_the_search_stays_in_its_box(found):
    guess = np.array(scenes.EIGHT_GUESS)
    for orbit in found:
        assert gap(orbit.y0, guess) < BOX
        assert abs(orbit.period - scenes.EIGHT_GUESS_PERIOD) < PERIOD_BOX


def test_every_stage_and_step_is_told():
    told, steps = [], []
    figure_eight(say=told.append, report=steps.append)
    assert [text.split(":")[0] for text in told] == ["closing plainly", "imposing the choreography"]
    starts = [i for i, step in enumerate(steps) if step.index == 0]
    assert len(starts) == 2
    assert steps[-1].residual < 1e-12 < 0.1 < steps[0].residual


def test_a_failed_first_stage_is_returned_for_both(neighbour):
    low = np.append(np.array(scenes.EIGHT_GUESS) - 0.01, 7.9)
    high = np.append(np.array(scenes.EIGHT_GUESS) + 0.01, 8.1)
    plain, eight = figure_eight(lower=low, upper=high)
    assert plain is eight
    assert plain.outcome == orbits.Outcome.BOUND
    assert (low[:-1] <= plain.y0).all()
    assert (plain.y0 <= high[:-1]).all()
    assert plain.residual > 0.1


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"m": (1.0, 1.0, 1.1)}, r"masses: expected equal ones, got \(1.0, 1.0, 1.1\)"),
        ({"m": (1.0, 1.0, -1.0)}, r"mass: expected >= 0, got -1.0"),
        ({"period": 0.0}, r"period: expected > 0, got 0.0"),
        ({"guess": (0.0,) * 11}, r"y0: expected shape \(12,\), got shape \(11,\)"),
        ({"guess": (np.nan,) * 12}, r"y0: expected finite numbers, got nan at index \[0\]"),
        ({"guess": (0.0,) * 12}, r"bodies at different points, got bodies 1 and 2 both at"),
    ],
)
def test_misuse(changed, message):
    with pytest.raises(ValueError, match=message):
        figure_eight(**changed)
