"""Searches: closed forms are found, however the work is split, broken off or sent away."""

import concurrent.futures as futures
import itertools
import json
import multiprocessing
import sys
import time

import numpy as np
import pytest
from helpers import refusal
from two_cycles import G, two_cycles
from typer.testing import CliRunner

import jaxdyn
import orbits
from jaxdyn import ensemble, scenes
from jaxdyn.ensemble import watches
from orbits.cli.app import app
from orbits.discovery import journal as table
from orbits.discovery import plane, seeds
from orbits.discovery import screening as screen
from orbits.discovery.chunks import seed_from

#: The module; as a name of the package it is the function.
search = sys.modules["orbits.discovery.search"]

PERIODS = (2 * np.pi / 5, np.pi)
MULTIPLIERS = (np.exp(-48 * np.pi * G / 5), np.exp(6 * np.pi * G))
SAMPLES, CHUNK = 6, 2


def searched(**options):
    options = {"longest": 3.5, "windows": 2, "chunk": CHUNK, **options}
    box = orbits.Box((0.6, 0.6), (1.6, 1.6))
    return orbits.search(two_cycles(), box, SAMPLES, **options)


class Line(futures.Executor):
    """Works in this thread, on the newest first, and remembers on what."""

    def __init__(self):
        self.did = []

    def submit(self, fn, /, *args, **kwargs):
        future = futures.Future()
        self.did.append(args[1])
        future.set_result(fn(*args, **kwargs))
        return future


class Backwards(Line):
    """The same, and hands the chunks back in the opposite order."""

    def submit(self, fn, /, *args, **kwargs):
        plan, number = args
        return super().submit(fn, plan, plan.chunks - 1 - number, **kwargs)


@pytest.fixture(scope="module")
def both():
    return searched()


def test_a_label_that_does_not_fit_the_scene_surfaces():
    with pytest.raises(ValueError, match="orbit: expected three free points in the plane"):
        searched(label=orbits.analysis.word)


@pytest.mark.slow
def test_both_cycles_are_found_with_their_exact_periods_and_multipliers(both):
    assert len(both) == 2
    np.testing.assert_allclose([f.period for f in both.finds], PERIODS, rtol=1e-11)
    np.testing.assert_allclose([np.hypot(*f.y0) for f in both.finds], [2.0, 1.0], rtol=1e-11)
    assert [f.verdict for f in both.finds] == ["stable", "unstable"]
    np.testing.assert_allclose(
        [max(1.0, m) for m in MULTIPLIERS], [f.multiplier for f in both.finds], rtol=1e-8
    )
    assert all(f.recheck < 1e-11 for f in both.finds)
    assert all(orbit.ok for orbit in both.orbits())
    assert both.counts["samples"] == SAMPLES
    counts = [both.counts[name] for name in ("guesses", "refined", "polished", "orbits")]
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] >= 2


@pytest.mark.slow
@pytest.mark.parametrize("executor", [Line, Backwards])
def test_the_table_is_the_same_whoever_works_in_which_order(both, executor):
    again = searched(executor=executor())
    assert again.finds == both.finds
    assert again.counts == both.counts


def test_other_seeds_are_other_samples():
    box = orbits.Box((0.0,), (1.0,))
    one, two = (box(np.arange(5), seed) for seed in (0, 1))
    assert (one != two).all()
    np.testing.assert_array_equal(box(np.array([3]), 0), one[3:4])


def test_a_search_goes_on_where_its_file_ends(both, tmp_path):
    path = tmp_path / "search.jsonl"
    first = Line()
    assert searched(path=path, executor=first).finds == both.finds
    assert sorted(first.did) == [0, 1, 2]
    whole = path.read_bytes()
    lines = whole.splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:2]) + lines[2][: len(lines[2]) // 2])  # cut off while written
    assert [chunk.number for chunk in table.read(path)[1]] == [0]
    second = Line()
    assert searched(path=path, executor=second).finds == both.finds
    assert sorted(second.did) == [1, 2]
    assert path.read_bytes() == whole
    third = Line()
    assert searched(path=path, executor=third).finds == both.finds
    assert third.did == []


def test_an_interrupt_loses_nothing(both, tmp_path, monkeypatch):
    path = tmp_path / "search.jsonl"
    wait, calls = futures.wait, itertools.count()

    def interrupted(*args, **kwargs):
        if next(calls):
            raise KeyboardInterrupt
        return wait(*args, **kwargs)

    monkeypatch.setattr(search.futures, "wait", interrupted)
    monkeypatch.setattr(search, "_AHEAD", 1)
    with pytest.raises(KeyboardInterrupt):
        searched(path=path, executor=Line())
    kept = [chunk.number for chunk in table.read(path)[1]]
    assert kept == [0, 1]  # the second one was under way
    monkeypatch.undo()
    rest = Line()
    assert searched(path=path, executor=rest).finds == both.finds
    assert rest.did == [2]


def test_a_chunk_that_comes_twice_counts_once(both, tmp_path):
    file = table.File(tmp_path / "search.jsonl", {"what": 1})
    chunk = table.Chunk(0, {"samples": 3}, tuple(both.finds))
    file.add(chunk)
    file.add(chunk)
    header, chunks = table.read(tmp_path / "search.jsonl")
    assert header["what"] == 1
    assert chunks == [chunk]


def test_progress_is_shown(capsys, both):
    assert searched(progress=True).finds == both.finds
    assert f"{SAMPLES} samples" in capsys.readouterr().out


def test_an_equilibrium_is_no_orbit():
    near = orbits.discovery.Starts(1e-3 * np.eye(2))
    assert len(orbits.search(two_cycles(), near, 2, longest=0.5, close=1e-2)) == 0


def test_a_search_that_finds_no_guess_says_what_to_change():
    near = orbits.discovery.Starts(1e-3 * np.eye(2))
    found = orbits.search(two_cycles(), near, 2, longest=0.5, close=1e-2)
    assert found.counts["guesses"] == 0
    assert "No motion returned within close = 0.01. Raise close" in repr(found)


def test_a_search_does_not_depend_on_the_start_of_the_scene(both):
    scene = two_cycles().starting([1e-4, 0.0])
    found = orbits.search(
        scene, orbits.Box((0.6, 0.6), (1.6, 1.6)), SAMPLES, longest=3.5, windows=2, chunk=CHUNK
    )
    assert found.counts == both.counts
    assert found.finds == both.finds


@pytest.mark.slow
def test_all_short_cycles_of_lorenz_are_found_from_its_attractor():
    """One for each word of two lobes up to four letters: AB, AAB, ABB, AAAB, AABB, ABBB."""
    scene = scenes.lorenz()  # which starts far from the attractor, at (1, 1, 1)
    ys = np.asarray(jaxdyn.simulate(scene, 100.0, samples=200).ys)[50:]
    found = orbits.search(scene, orbits.discovery.Starts(ys), 64, longest=3.2, shortest=1.0)
    published = [1.5586522, 2.3059073, 2.3059073, 3.0235837, 3.0235837, 3.0842768]  # Viswanath
    np.testing.assert_allclose([f.period for f in found.finds], published, rtol=1e-7)


def test_what_runs_away_is_cut_short():
    guesses = screen.close_returns(
        two_cycles(),
        [[1.5, 0.0], [3.0, 0.0]],
        orbits.PLAIN,
        shortest=0.0,
        longest=4.0,
        windows=2,
        close=10.0,
        limit=2.2,
        each=np.ones(2),
    )
    assert set(guesses.index) == {0}


@pytest.mark.slow
def test_each_window_has_its_closest_return():
    scene = two_cycles()
    later, before = np.array([0.0, 1.5, 2.8]), np.array([1.5, 2.8, 4.0])
    y0s = np.array([[2.0, 0.0], [1.3, 0.4]])

    def best(later, before):
        watch = watches.CloseReturn.of(scene, later=later, before=before)
        return ensemble.run(scene, y0s, 4.0, watch=watch).seen.best

    together = best(later, before)
    for i in range(3):
        alone = best(later[i], before[i])
        np.testing.assert_array_equal(together.after[:, i], alone.after)
        np.testing.assert_array_equal(together.distance[:, i], alone.distance)
    np.testing.assert_allclose(together.after[0], PERIODS[0] * np.arange(1, 4), rtol=1e-4)


def test_refined_guesses_are_on_the_cycles():
    guesses = screen.Guesses(
        np.arange(3),
        np.array([[1.05, 0.0], [0.0, 2.1], [1.0, 0.1]]),
        np.array([3.0, 1.3, 0.2]),
        np.ones(3),
    )
    found = screen.refine(two_cycles(), orbits.PLAIN, guesses, np.ones(2))
    assert list(found.index[:2]) == [0, 1]
    np.testing.assert_allclose(np.hypot(*found.y0s[:2].T), [1.0, 2.0], atol=1e-6)
    np.testing.assert_allclose(found.periods[:2], PERIODS[::-1], atol=1e-6)


def test_an_eight_in_any_frame_is_the_planes_row():
    scene, seed = seeds.row(0.3471168881, 0.5327249454, 6.3259139829)
    orbit = orbits.find(scene, seed.y0, seed.period, closing=orbits.reversal(plane.IN_LINE))
    angle, size = 0.7, 1.9
    c, s = np.cos(angle), np.sin(angle)
    r, v = np.asarray(orbit.y0).reshape(2, 3, 2) @ np.array([[c, -s], [s, c]])
    moved = np.concatenate([(size * r + 3.0).ravel(), (-(size**-0.5) * v + 0.2).ravel()])
    scene = scene.starting(moved, orbit.period * size**1.5)
    form = plane.in_plane(orbits.Orbit(scene, orbit.closing, 0.0, orbit.outcome, 0, orbit.rtol))
    np.testing.assert_allclose(form.y0[6:8], [0.3471168881, 0.5327249454], rtol=1e-9)
    assert form.period == pytest.approx(6.3259139829, rel=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"longest": -1.0}, "longest: expected > 0"),
        ({"shortest": 9.0}, "shortest: expected a period below longest"),
        ({"windows": 0}, "windows: expected a whole number"),
        ({"chunk": 0}, "chunk: expected a whole number"),
        ({"close": 0.0}, "close: expected > 0"),
        ({"path": "/nowhere/at/all"}, "path: expected a file in a folder that exists"),
    ],
)
def test_misuse(options, message):
    with pytest.raises(ValueError, match=message):
        searched(**options)


def test_a_turn_and_starts_of_another_size_are_refused():
    scene, box = scenes.three_body(), orbits.Box((0.0,) * 12, (1.0,) * 12)
    with pytest.raises(ValueError, match="one without an unknown turn"):
        orbits.search(scene, box, 4, longest=5.0, closing=orbits.relative())
    with pytest.raises(ValueError, match="sampler: expected starts of shape"):
        orbits.search(scene, orbits.Box((0.0,), (1.0,)), 4, longest=5.0)


def test_files_of_other_searches_are_refused(tmp_path):
    path = tmp_path / "search.jsonl"
    searched(path=path, executor=Line())
    with pytest.raises(ValueError, match=r"path: expected a file of this search.*seed"):
        searched(path=path, seed=1)
    path.write_text('{"format": "other"}\n')
    with pytest.raises(ValueError, match="path: expected a jaxdyn-search file"):
        searched(path=path)
    path.write_text(json.dumps({"no": 1}) + "\nnonsense\n")
    with pytest.raises(ValueError, match="path: expected a jaxdyn-search file"):
        table.read(path)


@pytest.mark.slow
def test_processes_find_the_same(both):
    context = multiprocessing.get_context("spawn")
    with futures.ProcessPoolExecutor(2, mp_context=context) as pool:
        again = searched(executor=pool)
    assert again.finds == both.finds
    assert again.counts == both.counts


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of a worker that is killed
def test_machines_of_a_dask_cluster_find_the_same_though_one_dies(both, tmp_path):
    distributed = pytest.importorskip("distributed", reason="dask is not installed")
    path = tmp_path / "search.jsonl"
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
        futures.ThreadPoolExecutor(1) as aside,
    ):
        running = aside.submit(searched, path=path, chunk=1, executor=client.get_executor())
        while not running.done() and len(table.read(path)[1] if path.exists() else ()) < 2:
            time.sleep(0.05)
        assert not running.done(), "no chunk is left to be lost"
        busy = next(iter(cluster.workers.values()))
        # Were it started again while the cluster closes, that could hold up the closing.
        busy.close_gracefully()
        busy.process.process._process.kill()
        again = running.result(timeout=300)
    assert again.counts["samples"] == SAMPLES
    numbers = [json.loads(line)["number"] for line in path.read_text().splitlines()[1:]]
    assert sorted(numbers) == list(range(SAMPLES))
    alone = searched(chunk=1)
    assert again.finds == alone.finds
    assert again.counts == alone.counts


@pytest.mark.slow
def test_the_command_finds_the_eight_and_goes_on_from_its_table(tmp_path):
    table = tmp_path / "plane.jsonl"
    options = ["search", "--samples", "8", "--longest", "8", "--table", str(table), "--json"]
    first, again = (CliRunner().invoke(app, options) for _ in range(2))
    assert first.exit_code == again.exit_code == 0
    found = json.loads(first.stdout)
    assert json.loads(again.stdout) == found
    eight = next(orbit for orbit in found["orbits"] if orbit["name"] == "figure-eight")
    assert abs(eight["scale_free"] - 9.2376812507246) < 1e-9
    assert (eight["word"], eight["verdict"]) == ("ABab", "stable")


def searched_row(**options):
    options = {
        "sampler": orbits.discovery.Starts([[1.0, 0.0]]),
        "samples": 1,
        "longest": 5.0,
    } | options
    return orbits.search(scenes.oscillator(k=4.0), **options)


def test_rng_is_the_seed_or_draws_it():
    drawn = seed_from(0, np.random.default_rng(3))
    assert seed_from(4, None) == seed_from(0, 4) == seed_from(0, np.int64(4)) == 4
    assert drawn == seed_from(0, np.random.default_rng(3)) != seed_from(0, np.random.default_rng(4))
    seen = []

    def sampler(numbers, seed):
        seen.append(seed)
        return np.tile([1.0, 0.0], (len(numbers), 1))

    searched_row(sampler=sampler, rng=np.random.default_rng(3))
    assert {*seen} == {drawn}


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: searched_row(seed=1, rng=2), "rng: expected either rng or seed, got both"),
        (lambda: searched_row(rng=1.5), "rng: expected a whole number or a generator of NumPy"),
        (lambda: searched_row(rng=-1), "seed: expected a whole number, at least 0, got -1"),
        (
            lambda: searched_row(samples=1.5),
            "samples: expected a whole number, at least 1, got 1.5",
        ),
        (lambda: searched_row(seed=-1), "seed: expected a whole number, at least 0, got -1"),
        (lambda: searched_row(seed=2**60), "seed: expected at most 9007199254740992"),
        (lambda: searched_row(rtol=np.nan), "rtol: expected between"),
        (lambda: searched_row(limit=np.nan), "limit: expected finite numbers"),
        (lambda: orbits.search_plane(1, longest=np.nan), "longest: expected finite numbers"),
    ],
)
def test_invalid_arguments_are_refused_by_name(call, message):
    assert message in refusal(call)


@pytest.mark.parametrize(
    ("sampler", "message"),
    [
        (orbits.Box([np.nan, 0.0], [1.0, 1.0]), r"^low: expected finite numbers, got nan"),
        (orbits.Box([0.0, 0.0], [1.0, np.inf]), r"^high: expected finite numbers, got inf"),
        (orbits.Box([0.0, 0.0], [1.0]), r"^high: expected shape \(2,\), got shape \(1,\)"),
        (orbits.discovery.Starts([[1.0, np.nan]] * 3), r"^y0s: expected finite numbers, got nan"),
        (
            orbits.discovery.Starts([[1.0, 0.0]]),
            r"^samples: expected at most the 1 rows of Starts, got more",
        ),
        (
            orbits.discovery.Starts([1.0, 0.0, 0.0]),
            r"^y0s: expected shape \(any, any\), got shape \(3,\)",
        ),
    ],
)
def test_samples_that_are_no_numbers_are_refused(sampler, message):
    with pytest.raises(ValueError, match=message):
        orbits.search(scenes.oscillator(), sampler, 3, longest=10.0)
