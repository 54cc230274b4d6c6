"""Crossings of many starts with a section, on all cores: `orbits.section`."""

import dataclasses
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from rich.progress import Progress

from jaxdyn import Scene, Status, _labelled, _text, ensemble
from jaxdyn._checks import check_first, check_on_host, fail, finite, numbers, whole
from jaxdyn._labelled import Labelled, Values, entries
from jaxdyn._progress import report_progress
from jaxdyn._text import second
from jaxdyn.analysis.energy import change
from jaxdyn.ensemble.crossings import EachCrossing
from jaxdyn.integrate.event_search.all_crossings import crossings
from jaxdyn.integrate.events import Event, as_events
from jaxdyn.integrate.spans import MAX_STEPS, RTOL
from jaxdyn.plan import plan_of
from jaxdyn.scene import check_scene
from jaxdyn.solvers import Solver
from orbits.sections.completion import Completed, outcome_text
from orbits.sections.coordinates import names_of, pair

#: Most crossings of a start in one call of the compiled program.
_CROSSINGS_A_CALL = 16
_CHUNK = 512  # starts in a queue


class SectionPoints(NamedTuple):
    """The crossings of n starts with a section, N for each start.

    Attributes:
      scene: the scene.
      event: the section.
      names: names of the two section coordinates (q, p).
      qp: (n, N, 2) their values; angles are between -pi and pi.
      ts: (n, N) times of the crossings; NaN where there are fewer, as in all arrays.
      ys: (n, N, k) states at these times.
      directions: (n, N) 1 where the event's value rises along the motion, -1 where it falls.
      counts: (n,) number of crossings found.
      status: (n,) `Status` codes.
      energies: (n,) energy of each start [J]; NaN for a scene without one.
      drift: (n,) largest relative change of the energy over the crossings, see
        `energy.drift`; where the energy is conserved, that is the error of the integration. NaN
        without an energy.
    """

    scene: Scene
    event: Event
    names: tuple[str, str]
    qp: np.ndarray
    ts: np.ndarray
    ys: np.ndarray
    directions: np.ndarray
    counts: np.ndarray
    status: Annotated[np.ndarray, Status]
    energies: np.ndarray
    drift: np.ndarray

    @_text.never_raising
    def __repr__(self) -> str:
        unknown = () if self.scene.has_energy else ("energies", "drift")
        rows = [row for row in _text.field_rows(self) if row[0] not in unknown]
        return _text.table("SectionPoints", rows)

    _repr_html_ = _text.html
    to_pandas = _labelled.to_pandas
    to_xarray = _labelled.to_xarray

    def _to_labelled(self) -> Labelled:
        labels = self.scene.labels()
        axes, starts, time = ("start", "crossing"), ("start",), second(labels)
        # Section coordinates replace those of the state, whose angles may have turned.
        coordinates = [(name, dict(labels).get(name, "")) for name in self.names]
        states = entries(axes, self.ys, labels) | entries(axes, self.qp, coordinates)
        return Labelled(
            {"t": Values(axes, self.ts, time or "1")},
            {
                **states,
                "direction": Values(axes, self.directions),
                "count": Values(starts, self.counts),
                "status": Values(starts, self.status),
                "energy": Values(starts, self.energies, self.scene.in_units("J") or "1"),
                "drift": Values(starts, self.drift, "1"),
            },
        )

    @property
    def ok(self) -> np.ndarray:
        """(n,) whether all crossings of each start were found."""
        return self.status == Status.OK

    @property
    def message(self) -> str:
        """The number of starts with each status, and the remedies."""
        return outcome_text(self.status)


@check_first
def section(
    scene: Scene,
    event: Event,
    starts=None,
    *,
    crossings: int = 100,
    t1: float | None = None,
    coordinates: Sequence[str] | None = None,
    rtol: float = RTOL,
    atol: float | None = None,
    solver: Solver | None = None,
    max_steps: int = MAX_STEPS,
    threads: int | None = None,
    progress: bool = False,
) -> SectionPoints:
    """The first crossings of many starts with a surface of section, on all cores.

    Args:
      scene: the scene, with the numbers of all starts.
      event: the section, with the direction that counts; `events.Every` for a stroboscope.
      starts: (n, k) states, or what `sections.complete` returned; the scene's own by default. A
        start on the section does not count as a crossing.
      crossings: number of crossings of each start.
      t1: () latest time of a crossing; by default the scene's span for each crossing, and one more,
        since the start does not count.
      coordinates: names of the two entries of the state that are drawn; by default a position
        and its velocity.
      rtol: see `simulate`.
      atol: see `simulate`.
      solver: see `simulate`.
      max_steps: largest number of steps for every 16 crossings.
      threads: see `ensemble.run`.
      progress: show a bar.
    Returns:
      The crossings, in NumPy arrays. A start that fails, or crosses less often, keeps its earlier
      crossings and has a status with a remedy; it does not affect the others.
    Raises:
      ValueError: `event` is not an event, `starts` has a wrong shape, `crossings` is not positive,
        or another number is out of range, as for `simulate`.
    Limits: starts of a rate with conditions, as with dry friction or a square wave, run one after
      the other. No derivatives (`jaxdyn.crossings` has them for one motion, `sections.poincare_map`
      for the map). Points of chaotic motions lose their digits as motions do: the distribution is
      meaningful, not each late point; `drift` does not measure that.
    Example:
      >>> import jaxdyn, orbits
      >>> from jaxdyn import scenes
      >>> from jaxdyn.integrate import events
      >>> scene, plane = scenes.henon_heiles(), events.Reaches(0, 0.0, 1)
      >>> starts = orbits.sections.complete(scene, plane, {"y": [0.1, 0.2], "vy": 0.0}, energy=0.1)
      >>> found = orbits.section(scene, plane, starts, crossings=8)
      >>> found.qp.shape, found.counts.tolist(), bool(found.drift.max() < 1e-10)
      ((2, 8, 2), [8, 8], True)
    """
    check_on_host("starts", (scene, starts), "jaxdyn.crossings works under jit, grad and vmap.")
    check_scene(scene)
    (event,) = as_events((event,), len(scene.y0))
    n_wanted = whole("crossings", crossings)
    shown = pair(scene, event, coordinates)
    y0s, status = _starts(scene, starts)
    end = float(finite("t1", numbers("t1", (n_wanted + 1) * scene.t1 if t1 is None else t1)))
    options = {"rtol": rtol, "atol": atol, "solver": solver, "max_steps": max_steps}
    table = _Table(scene, event, y0s, status, n_wanted)
    total = n_wanted * int((status == Status.OK).sum())
    with Progress(disable=not progress) as bar:
        task = bar.add_task("crossings", total=total)
        while table.running.any():
            bar.update(task, completed=int(table.counts.sum()))
            report_progress("crossing the section", int(table.counts.sum()), total)
            table.go_on(end, threads=threads, **options)
        bar.update(task, completed=total)
    energies, drift = _energies(scene, y0s, table)
    labels = names_of(scene)
    return SectionPoints(
        scene=scene,
        event=event,
        names=(labels[shown[0]], labels[shown[1]]),
        qp=_wrap_angles(scene, table.ys, shown),
        ts=table.ts,
        ys=table.ys,
        directions=table.directions,
        counts=table.counts,
        status=table.status,
        energies=energies,
        drift=drift,
    )


class _Table:
    """The crossings so far; starts continue from their last ones."""

    def __init__(self, scene: Scene, event: Event, y0s: np.ndarray, status: np.ndarray, n: int):
        rows, k = y0s.shape
        self.scene, self.event, self.wanted = scene, event, n
        self.ts, self.ys = np.full((rows, n), np.nan), np.full((rows, n, k), np.nan)
        self.directions = np.zeros((rows, n), int)
        self.counts, self.status = np.zeros(rows, int), status
        self.running = status == Status.OK
        self._t, self._y = np.zeros(rows), y0s.copy()

    def go_on(self, end: float, *, threads, **options) -> None:
        """Find the next crossings of all starts that need more."""
        rows = np.flatnonzero(self.running)
        # All starts that are still running have the same number of crossings.
        done = int(self.counts[rows[0]])
        most = min(_CROSSINGS_A_CALL, self.wanted - done)
        if plan_of(self.scene.field, self._y.shape[1]).size:
            self._put(rows, done, most, *self._piecewise(rows, end, **options))
            return
        watch = EachCrossing(self.scene.field, self.event, jnp.asarray(most), _CROSSINGS_A_CALL)
        out = ensemble.run(
            self.scene,
            self._y[rows],
            end,
            t0=self._t[rows],
            watch=watch,
            chunk=_CHUNK,
            threads=threads,
            **options,
        )
        seen = out.seen
        status = np.where((out.status == Status.OK) & seen.lost, Status.NOT_FINITE, out.status)
        self._put(rows, done, most, seen.ts, seen.ys, seen.directions, seen.count, status)

    def _piecewise(self, rows: np.ndarray, end: float, **options) -> list[np.ndarray]:
        """The next crossings of some starts, one after the other, for a rate with conditions.

        An ensemble has no watches for these. The result has times, states, directions, numbers of
        crossings, and status codes.
        """
        options |= {"most": min(_CROSSINGS_A_CALL, self.wanted), "throw": False}
        starts = (dataclasses.replace(self.scene, y0=self._y[i]) for i in rows)
        found = [
            crossings(scene, self.event, end, t0=t, **options)
            for scene, t in zip(starts, self._t[rows], strict=True)
        ]
        return [np.stack(parts) for parts in zip(*found, strict=True)]

    def _put(self, rows: np.ndarray, done: int, most: int, ts, ys, directions, count, status):
        """Add at most `most` crossings of some starts, which had `done` before."""
        place, going = slice(done, done + most), count >= most
        self.ts[rows, place] = ts[:, :most]
        self.ys[rows, place] = ys[:, :most]
        self.directions[rows, place] = directions[:, :most]
        self.counts[rows] += np.minimum(count, most)
        self._t[rows], self._y[rows] = ts[:, most - 1], ys[:, most - 1]
        ended = np.where(status == Status.OK, Status.FEW_CROSSINGS, status)
        self.status[rows] = np.where(going, Status.OK, ended)
        self.running[rows] = going & (done + most < self.wanted)


def _starts(scene: Scene, starts) -> tuple[np.ndarray, np.ndarray]:
    """(n, k) starts, and the status of each."""
    k = len(scene.y0)
    if isinstance(starts, Completed):
        return np.array(starts.y0s), np.array(starts.status)
    y0s = np.array(numbers("starts", scene.y0[None] if starts is None else starts))
    if y0s.ndim != 2 or y0s.shape[1] != k or not len(y0s):
        remedy = f"Pass one row for each start: {', '.join(names_of(scene))}."
        raise fail("starts", f"shape (n, {k})", f"shape {y0s.shape}", remedy)
    right = np.isfinite(y0s).all(axis=1)
    return y0s, np.where(right, int(Status.OK), int(Status.NOT_FINITE))


def _wrap_angles(scene: Scene, ys: np.ndarray, shown: tuple[int, int]) -> np.ndarray:
    """The values of the section coordinates, angles between -pi and pi."""
    units = [scene.labels()[i][1] for i in shown]
    qp = ys[..., list(shown)]
    turned = (qp + np.pi) % (2 * np.pi) - np.pi
    return np.where(np.array(units) == "rad", turned, qp)


@jax.jit
def _change(scene: Scene, ts, ys):
    found = jax.vmap(lambda ts, ys: change(scene, ts, ys))(ts, ys)
    return found.values[:, 0], found.relative


def _energies(scene: Scene, y0s: np.ndarray, table: _Table) -> tuple[np.ndarray, np.ndarray]:
    """Energy of each start, and its relative change over the crossings."""
    nothing = np.full(len(y0s), np.nan)
    if not scene.has_energy:
        return nothing, nothing
    there = np.arange(table.wanted) < table.counts[:, None]
    ts = np.concatenate([np.zeros((len(y0s), 1)), np.where(there, table.ts, 0.0)], axis=1)
    ys = np.where(there[..., None], table.ys, y0s[:, None])
    energies, drift = _change(scene, ts, np.concatenate([y0s[:, None], ys], axis=1))
    return np.asarray(energies), np.where(table.counts > 0, drift, np.nan)
