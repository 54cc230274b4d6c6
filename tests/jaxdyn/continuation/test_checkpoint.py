"""Families of equilibria and curves in files: resumed after an interruption, loaded, refused."""

import json

import numpy as np
import pytest

import jaxdyn
from jaxdyn import drawing, scenes
from jaxdyn.continuation import load
from jaxdyn.continuation.checkpoint import Log
from jaxdyn.files.digests import json_text


def lorenz(rho):
    return scenes.lorenz(rho=rho)


def imperfect(p, q):
    return jaxdyn.ode(lambda t, y, c: [c[0] + c[1] * y[0] - y[0] ** 3], [0.0], params=[p, q])


def family(path=None, members=12, **options):
    return jaxdyn.continue_equilibria(
        lorenz, 20.0, [7.0, 7.0, 19.0], members=members, step=0.5, path=path, **options
    )


def folds(path=None, **options):
    start = jaxdyn.continue_equilibria(
        lambda p: imperfect(p, 1.0), -1.0, [-1.3], within=(-1, 1)
    ).special[0]
    return jaxdyn.continue_curve(
        imperfect, start, (start.parameter, 1.0), down=True, members=25, path=path, **options
    )


def interrupt(after):
    """A report that stops the run, as Ctrl-C does, at a member."""
    seen = []

    def report(member):
        seen.append(member)
        if len(seen) == after:
            raise KeyboardInterrupt

    return report


def assert_same(a, b):
    assert (len(a.members), a.end) == (len(b.members), b.end)
    np.testing.assert_array_equal(a.parameters, b.parameters)
    np.testing.assert_array_equal(a.states, b.states)
    for one, two in zip((*a.members, *a.special), (*b.members, *b.special), strict=True):
        assert one.kind == two.kind
        np.testing.assert_array_equal(one.tangent, two.tangent)
        np.testing.assert_array_equal(one.eigenvalues, two.eigenvalues)
        np.testing.assert_array_equal(one.coefficient, two.coefficient)


@pytest.mark.sample("7-family")
@pytest.mark.parametrize("follow", [family, folds])
@pytest.mark.parametrize("after", [1, 7])
def test_an_interrupted_run_goes_on_to_the_same_result(follow, after, tmp_path):
    path, whole = tmp_path / "run.jsonl", follow()
    with pytest.raises(KeyboardInterrupt):
        follow(path, report=interrupt(after))
    make = lorenz if follow is family else imperfect
    (part,) = load(path, make)
    assert (len(part.members), part.end) == (after, "an interruption")
    # A process that was killed leaves an incomplete line.
    path.write_bytes(path.read_bytes() + b'{"walk": 0, "step": {"memb')
    seen = []
    assert_same(follow(path, report=seen.append), whole)
    assert len(seen) == len(whole.members)
    (found,) = load(path, make)
    assert_same(found, whole)
    assert getattr(found, "before", None) == getattr(whole, "before", None)


def test_what_is_in_the_file_is_not_computed_again(tmp_path, monkeypatch):
    path = tmp_path / "run.jsonl"
    whole, size = family(path), path.stat().st_size
    monkeypatch.setattr(jaxdyn.continuation.special.EquilibriumChart, "correct", None)
    assert_same(family(path), whole)
    assert path.stat().st_size == size


def test_a_run_may_go_on_further_and_a_file_has_several(tmp_path):
    path = tmp_path / "run.jsonl"
    family(path, members=4)
    assert_same(family(path, members=12), family())
    assert_same(family(path, down=True), family(down=True))
    up, down = load(path, lorenz)
    assert_same(up, family())
    assert_same(down, family(down=True))
    # Narrower bounds end a walk that the file has earlier.
    assert family(path, within=(0, 22)).end == "the bounds (0, 22)"


def test_pictures_are_drawn_of_what_was_loaded(tmp_path):
    path, picture = tmp_path / "run.jsonl", tmp_path / "a.png"
    family(path, within=(14, 28), members=40)
    drawing.equilibria(load(path, lorenz), picture, parameter="rho")
    assert picture.stat().st_size > 10_000
    folds(path)
    with pytest.raises(ValueError, match="make: expected the scenes of the file"):
        load(path, lorenz)  # the curve is one of other scenes
    path.unlink()
    folds(path)
    figure = drawing.bifurcation_curves(load(path, imperfect))
    assert figure.axes[0].get_xlabel() == "p"


def test_other_scenes_are_refused(tmp_path):
    path = tmp_path / "run.jsonl"
    family(path, members=3)
    with pytest.raises(
        ValueError, match=r"make: expected the scenes of the file, got others, with"
    ):
        load(path, lambda rho: scenes.lorenz(rho=rho, beta=1.0))
    with pytest.raises(ValueError, match=r"make: expected the scenes of the file, got [A-Z]\w+:"):
        load(path, lambda rho: scenes.pendulum(length=rho))


def test_another_file_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "notes.txt"
    for content in (b"my notes", b"my notes\n", b'{"format": "jaxdyn-search", "version": 3}\n'):
        path.write_bytes(content)
        with pytest.raises(ValueError, match="expected a jaxdyn-continuation file"):
            family(path, members=2)
        assert path.read_bytes() == content
    with pytest.raises(ValueError, match="path: expected a file in a folder that exists"):
        family(tmp_path / "nowhere" / "run.jsonl")
    with pytest.raises(ValueError, match="path: expected the path of a file, or None, got 3"):
        family(3)
    empty = tmp_path / "empty.jsonl"
    Log(empty)
    with pytest.raises(
        ValueError, match=r"path: expected a file of equilibria or curve, got .*none"
    ):
        load(empty, lorenz)


HOSTILE = [
    None,
    3,
    "x",
    [],
    {},
    [1e308],
    {"shape": [10**9], "real": []},
    {"shape": [-1], "real": []},
]


def _places(record, way=()):
    for key, item in record.items() if isinstance(record, dict) else ():
        yield (*way, key)
        yield from _places(item, (*way, key))


def test_whatever_stands_in_a_file_it_is_read_or_refused(tmp_path):
    path = tmp_path / "run.jsonl"
    folds(path)
    lines = [json.loads(line) for line in path.read_text().splitlines()][:12]
    lines = [{key: x for key, x in line.items() if key != "digest"} for line in lines]
    random = np.random.default_rng(3)
    read = 0
    for _ in range(60):
        records = json.loads(json.dumps(lines))
        record = records[random.integers(len(records))]
        *way, last = [*_places(record)][random.integers(len([*_places(record)]))]
        at = record
        for key in way:
            at = at[key]
        at[last] = HOSTILE[random.integers(len(HOSTILE))]
        path.write_bytes(b"".join(json_text(x) for x in records))
        try:
            load(path, imperfect)
            read += 1
        except ValueError as refused:
            assert str(refused)  # noqa: PT017
    assert read < 30


def test_an_edited_number_is_refused(tmp_path):
    path = tmp_path / "run.jsonl"
    family(path, members=3)
    path.write_text(path.read_text().replace('"stable"', '"unstable"'))
    with pytest.raises(ValueError, match="which is another or was edited"):
        load(path, lorenz)
