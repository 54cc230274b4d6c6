"""What the flow keeps is found where it is not named, proved, and counted in the multipliers."""

import csv
import dataclasses
import functools
from fractions import Fraction
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
import orbits
from benchmarks import proofs
from jaxdyn import scenes
from jaxdyn.ball_arithmetic.arithmetic import acb, arb, arb_mat, precision
from jaxdyn.ball_arithmetic.field import ball_field, scene_formulas
from orbits.proof import posing, proving
from orbits.proof.posing import equations_of
from orbits.proof.stability import multipliers, structure
from orbits.proof.stability.structure import forms_of

_TABLE = Path(__file__).parents[2] / "published_three_body.csv"


@functools.cache
def _first_row():
    """The published orbit that is linearly stable, in reduced coordinates without symmetries."""
    rows = csv.DictReader(_TABLE.read_text().splitlines())
    row = next(one for one in rows if one["name"] == "I.A^ic_1")
    a, b, period = (float(row[name]) for name in ("v1", "v2", "period"))
    return orbits.find(proofs.scene(a, b, period), closing=proofs.RETRACED, rtol=1e-13)


@functools.cache
def _cycle():
    rate = lambda t, y: [y[1], (1 - y[0] ** 2) * y[1] - y[0]]  # noqa: E731
    return equations_of(orbits.find(jaxdyn.ode(rate, [2.0, 0.0], 6.66)))


def _system(rate, y0, **more):
    """Equations with this rate; what else they say is not of interest here."""
    scene = jaxdyn.ode(rate, y0, 1.0, **more)
    formulas, (found,) = scene_formulas(scene, posing._integrals)
    unit, k = np.eye(len(y0), dtype=int), len(y0)
    return dataclasses.replace(
        _cycle(),
        formulas=formulas,
        field=ball_field(formulas),
        candidates=tuple(found),
        embed=unit,
        end=unit,
        goal=unit,
        names=(*(f"y{i}" for i in range(k)), "period"),
        values=(*(float(x) for x in y0), 1.0),
        held=(),
        sizes=(1.0,) * k,
    )


def test_the_form_of_reduced_coordinates_has_their_masses():
    (form,) = forms_of(equations_of(_first_row()))
    # Kinetic energy p'^2 / 4 + 3 q'^2 / 4: masses 1/2 and 3/2.
    masses = [Fraction(1), Fraction(1), Fraction(3), Fraction(3)]
    wanted = np.kron([[0, 1], [-1, 0]], np.diag(masses))
    assert (form * masses[2] / form[2, 6] == wanted).all()


@pytest.mark.parametrize(
    "rate",
    [
        lambda t, y: [y[1], (1 - y[0] ** 2) * y[1] - y[0]],  # contracts areas
        lambda t, y: [y[1], -(y[0] ** 3) - 0.1 * y[1]],
    ],
)
def test_a_rate_that_contracts_has_no_form(rate):
    assert forms_of(_system(rate, [1.0, 0.5])) == []


def test_forms_that_are_singular_alone_are_added():
    # Two oscillators: each has a form of its own, which is singular.
    system = _system(lambda t, y: [y[1], -(y[0] ** 3), y[3], -jnp.sin(y[2])], np.ones(4))
    found = structure.structure(system, {}, [], forms_of(system))
    assert found.form is not None
    assert structure._rational(found.form).det() != 0


def test_a_form_with_other_masses_is_refused():
    system = equations_of(_first_row())
    (form,) = forms_of(system)
    wrong = form.copy()
    wrong[2, 6], wrong[6, 2] = 2 * form[2, 6], -2 * form[2, 6]
    assert structure.structure(system, {}, [], [wrong]).form is None
    assert structure.structure(system, {}, [], [wrong, form]).form is not None


def _prescribed(orbit, system):
    forms = forms_of(system)
    own = proving.symplectic_form(orbit.scene, orbit.y0)
    forms = [np.asarray(own)] if own is not None else forms
    known = structure.structure(system, posing.integrals_of(system, orbit.scene), [], forms)
    with precision(200):
        return structure.prescribe(system, system.centre(), known)


def test_integrals_have_their_directions_by_the_form():
    found = _prescribed(_first_row(), equations_of(_first_row()))
    assert (len(found.rows), len(found.directions)) == (2, 2)


def test_the_momentum_of_a_relative_orbit_turns_with_it():
    scene = scenes.three_body()
    formulas, (found,) = scene_formulas(scene, posing._integrals)
    turn = posing._generator(scene, orbits.relative())
    unit = np.eye(12, dtype=int)
    system = dataclasses.replace(
        _cycle(),
        formulas=formulas,
        field=ball_field(formulas),
        candidates=tuple(found),
        generator=turn,
        embed=unit,
        end=unit,
        goal=unit,
        names=(*(f"y{i}" for i in range(12)), "period", "angle"),
        values=(*np.asarray(scene.y0).tolist(), 6.3, 0.3),
        sizes=(1.0,) * 12,
    )
    orbit = orbits.Orbit(scene, orbits.relative(), 0.0, orbits.Outcome.FOUND, 0, 1e-9)
    found = _prescribed(orbit, system)
    # Energy and angular momentum; the two entries of the momentum; and their directions.
    assert (len(found.rows), len(found.directions)) == (4, 4)
    with precision(200):
        assert [z.overlaps(w) for z, w in zip(found.multipliers, _one_and(0.3), strict=True)]
        # A rotation that may be none prescribes nothing of the momentum.
        still = dataclasses.replace(system, values=(*system.values[:-1], 0.0))
        assert len(_prescribed(orbit, still).rows) == 2


def _one_and(angle: float) -> list[acb]:
    return [acb(1), acb(arb(angle).cos(), arb(angle).sin())]


def test_multipliers_near_one_are_enclosed_beside_those_that_are_one():
    # In a random basis: a block of four 1 that is not diagonal, and a pair 1e-3 away from 1.
    with precision(200):
        angle = arb("1e-3")
        c, s = angle.cos(), angle.sin()
        table = [[1, 2, 3, 4, 5, 6], [0, 1, 1, 2, 3, 1], [0, 0, c, -s, 2, 1], [0, 0, s, c, 1, 3]]
        table += [[0, 0, 0, 0, 1, 7], [0, 0, 0, 0, 0, 1]]
        basis = arb_mat(np.random.default_rng(1).standard_normal((6, 6)).tolist())
        ball = arb_mat([[arb(0, "1e-40")] * 6] * 6)
        matrix = basis * arb_mat(table) * basis.inv() + ball
        rows = basis.inv().tolist()[4:]
        directions = basis.transpose().tolist()[:2]
        exact = acb(c, s)
        reduced = multipliers.reduce(matrix, rows, directions)
        values = multipliers.roots(reduced.charpoly().coeffs())
        assert len(values) == 2
        assert any(z.contains(exact) for z in values)
        assert max(float(z.rad()) for z in values) < 1e-34
        divided = multipliers.roots(multipliers.deflate(matrix, 4))
        assert all(any(z.overlaps(w) for w in divided) for z in values)


def test_vectors_that_depend_on_each_other_reduce_nothing():
    matrix = arb_mat([[1, 0, 0], [0, 1, 0], [0, 0, 2]])
    with pytest.raises(ArithmeticError):
        multipliers.reduce(matrix, [], [[arb(1), arb(0), arb(0)], [arb(2), arb(0), arb(0)]])


@pytest.mark.slow
def test_a_published_orbit_is_proved_to_be_stable_in_reduced_coordinates():
    proof = orbits.prove(_first_row())
    assert (proof.proved, proof.verdict, proof.verdict_proved) == (True, "stable", True)
    # It is the figure-eight, whose rotation numbers Kapela and Simo enclosed.
    found = sorted(float(x.mid) for x in proof.exponents)
    assert np.allclose(found, [0.00842272, 0.29809253], atol=1e-8)


@pytest.mark.long
def test_an_eight_with_angular_momentum_is_proved_in_resting_axes():
    eight = orbits.find(scenes.three_body(), closing=orbits.choreography(3))
    r, v = np.asarray(eight.y0).reshape(2, 3, 2)
    turning = np.concatenate([r.ravel(), (v + 0.01 * r[:, ::-1] * [-1, 1]).ravel()])
    orbit = orbits.find(scenes.three_body(), turning, eight.period, closing=orbits.relative())
    proof = orbits.prove(orbit)
    assert (proof.proved, proof.verdict, proof.verdict_proved) == (True, "unstable", True)
    sizes = [abs(complex(float(a.mid), float(b.mid))) for a, b in proof.multipliers]
    known = orbits.stability(orbit).multipliers
    assert min(abs(abs(known) - sizes[0])) < 1e-6 * sizes[0]
