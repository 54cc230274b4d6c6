"""Discovery: from samples of starts to a table of distinct, verified orbits.

The samples are numbered and divided into chunks, the units of work, see `chunks`. The result of a
chunk depends only on its number and the seed, so the table does not depend on which worker
processes which chunk, when, or on how often the search was interrupted.
"""

import concurrent.futures as futures
import dataclasses
import itertools
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from jaxdyn import Scene, _text
from jaxdyn._checks import check_first, check_on_host, fail, positive, whole
from jaxdyn._progress import report_progress
from jaxdyn._text import number_of
from jaxdyn.ensemble.batches import cores
from jaxdyn.files.codec import encode, encode_scene
from jaxdyn.integrate.spans import tolerances
from orbits.closing.closings import PLAIN, Closing
from orbits.closing.given import pose
from orbits.discovery.chunks import MOST, Plan, Sampler, keep, no_label, seed_from, work
from orbits.discovery.journal import Chunk, File, Find, distinct
from orbits.discovery.screening import sizes_of_starts
from orbits.discovery.workers import pack
from orbits.orbit import Orbit
from orbits.shooting.finding import RTOL

_REMEDY = "Raise close, longest or samples, or start where the motions go."
_AHEAD = 64  # chunks submitted to an executor in advance


@dataclasses.dataclass(frozen=True)
class SearchResult:
    """The result of a search.

    Attributes:
      finds: distinct orbits, by invariant.
      counts: number of samples, guesses and orbits at each stage.
      plan: the arguments of the search.
    """

    finds: list[Find]
    counts: dict[str, int]
    plan: Plan

    @_text.never_raising
    def __repr__(self) -> str:
        rows = [
            (find.label or f"{i + 1}", f"period {_text.brief(find.period)}, {find.verdict}")
            for i, find in enumerate(self.finds)
        ]
        counts = ("counts", ", ".join(f"{n} {name}" for name, n in self.counts.items()))
        head = f"SearchResult: {number_of(len(rows), 'orbit')} of {_text.title_of(self.plan.scene)}"
        if not self.counts["guesses"]:
            rows.append(("", f"No motion returned within close = {self.plan.close:g}. {_REMEDY}"))
        return _text.table(head, [counts, *_text.shorten(rows)])

    _repr_html_ = _text.html

    def __len__(self) -> int:
        return len(self.finds)

    def orbits(self) -> list[Orbit]:
        """The finds as orbits."""
        plan = self.plan
        return [f.orbit(plan.scene, (plan.closing, PLAIN), plan.rtol) for f in self.finds]


@check_first
def search(
    scene: Scene,
    sampler: Sampler,
    samples: int,
    *,
    longest: float,
    shortest: float = 0.0,
    closing: Closing = PLAIN,
    windows: int = 8,
    close: float = 0.3,
    limit=np.inf,
    normal: Callable[[Orbit], Orbit] = keep,
    label: Callable[[Orbit], str] = no_label,
    seed: int = 0,
    rng: int | np.random.Generator | None = None,
    chunk: int = 64,
    rtol: float = RTOL,
    path: str | Path | None = None,
    executor: futures.Executor | None = None,
    progress: bool = False,
) -> SearchResult:
    """The distinct, verified orbits to which samples of starts lead.

    Args:
      scene: the scene.
      sampler: (indices (n,) of samples, seed) -> their starts (n, k); such as `Box` and `Starts`.
      samples: number of samples.
      longest: longest period.
      shortest: shortest period.
      closing: the closing condition. A symmetric one is cheaper and finds more.
      windows: number of parts of the range of periods, each with its own closest return.
      close: largest residual of a return that is a guess, in units of the sizes of the entries at
        the first chunk of starts (`jaxdyn.scales`).
      limit: (k,) or () magnitudes of the state beyond which a motion has escaped.
      normal: orbit -> the same orbit in the frame and scale of the table.
      label: orbit -> its name.
      seed: seed of the sampler.
      rng: instead of `seed`: the seed, or a generator that draws it.
      chunk: samples processed at once; the unit that an interrupted search repeats.
      rtol: tolerance of the orbits' integrations.
      path: file to which results are appended; a search continues its own file.
      executor: runs the chunks: by default threads on all cores; processes; other machines.
        It is sent `work`, the plan and indices, so functions in the plan must be module-level.
      progress: show a bar.
    Returns:
      The orbits found; the same for one seed and size of chunk, however the work is distributed.
      On Ctrl-C the chunks in progress are finished and kept, then KeyboardInterrupt propagates.
    Raises:
      ValueError: a period, `close`, `limit`, a count or a tolerance is out of range, `closing` has
        an unknown turn, `seed` and `rng` are both given, or `path` is a file of another search.
    Limits: a search proves nothing about orbits it has not found.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> starts = orbits.discovery.Starts([[1.0, 0.0]])
      >>> found = orbits.search(scenes.oscillator(k=4.0), starts, 1, longest=5)
      >>> [round(find.period, 6) for find in found.finds]
      [3.141593]
    """
    check_on_host(
        "search", scene, "Search outside of the transformation; see orbits.differentiable."
    )
    plan = Plan(
        scene=scene,
        sampler=sampler,
        closing=closing,
        samples=samples,
        chunk=chunk,
        seed=seed_from(seed, rng),
        shortest=float(shortest),
        longest=float(longest),
        windows=windows,
        close=close,
        limit=np.asarray(limit, float),
        each=np.ones(len(scene.y0)),
        normal=normal,
        label=label,
        rtol=rtol,
    )
    _check(plan)
    plan = plan._replace(each=sizes_of_starts(scene, _first_chunk(plan), plan.longest))
    file = File(path, {} if path is None else _header(plan))
    own = executor is None
    pool = futures.ThreadPoolExecutor(cores()) if executor is None else executor
    try:
        with _bar(progress) as bar:
            _work_through(plan, file, pool, bar)
    finally:
        if own:
            pool.shutdown(cancel_futures=True)
    chunks = [file.chunks[i] for i in range(plan.chunks)]
    finds = distinct((f for c in chunks for f in c.finds), scene, (closing, PLAIN), rtol)
    return SearchResult(finds, _sums(chunks), plan)


def _work_through(plan: Plan, file: File, pool: futures.Executor, bar: Progress) -> None:
    """Process the chunks that the file does not have yet."""
    sent = plan._replace(scene=pack(plan.scene))
    todo = iter([i for i in range(plan.chunks) if i not in file.chunks])
    task = bar.add_task("search", total=plan.chunks, completed=len(file.chunks), said="")
    waiting: dict[futures.Future, int] = {}

    def keep(done: Iterable[futures.Future]) -> None:
        for future in sorted(done, key=waiting.__getitem__):
            file.add(future.result())
            del waiting[future]
        sums = _sums(file.chunks.values())
        seconds = max(bar.tasks[task].elapsed or 0.0, 1e-9)
        said = ", ".join(f"{n} {name}" for name, n in sums.items())
        bar.update(task, completed=len(file.chunks), said=f"{said} in {seconds:.0f} s")
        report_progress(f"searching: {said}", len(file.chunks), plan.chunks)

    try:
        while True:
            for i in itertools.islice(todo, _AHEAD - len(waiting)):
                waiting[pool.submit(work, sent, i)] = i
            if not waiting:
                return
            keep(futures.wait(waiting, return_when=futures.FIRST_COMPLETED).done)
    except KeyboardInterrupt:
        keep([future for future in waiting if not future.cancel()])
        raise


def _sums(chunks: Iterable[Chunk]) -> dict[str, int]:
    sums: dict[str, int] = {}
    for chunk in chunks:
        for name, n in chunk.counts.items():
            sums[name] = sums.get(name, 0) + n
    return sums


def _bar(progress: bool) -> Progress:
    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, TextColumn("{task.fields[said]}"), disable=not progress)


def _check(plan: Plan) -> None:
    pose(plan.scene, closing=plan.closing, period=positive("longest", plan.longest))
    if plan.closing.turns:
        raise fail("closing", "one without an unknown turn", repr(plan.closing.name))
    if not 0 <= plan.shortest < plan.longest:
        raise fail("shortest", f"a period below longest = {plan.longest}", plan.shortest)
    for name in ("samples", "chunk", "windows"):
        whole(name, getattr(plan, name))
    whole("seed", plan.seed, least=0, most=MOST)
    tolerances(plan.rtol, None)
    positive("close", plan.close, "It is the largest residual of a guess.")
    positive("limit", np.minimum(plan.limit, np.finfo(float).max), "Beyond it motions are lost.")
    starts = np.asarray(plan.sampler(np.arange(1), plan.seed))
    k = len(plan.scene.y0)
    if starts.shape != (1, k):
        raise fail("sampler", f"starts of shape (n, {k})", f"shape {starts.shape}")


def _header(plan: Plan) -> dict[str, Any]:
    """The description that identifies a search."""
    names = ("samples", "chunk", "seed", "shortest", "longest", "windows", "close", "rtol")
    encoded = {"scene": encode_scene(plan.scene), "closing": encode(plan.closing)}
    return {
        **encoded,
        **{name: getattr(plan, name) for name in names},
        "limit": [str(x) for x in np.ravel(plan.limit)],
        "starts": np.asarray(_first_chunk(plan)).tolist(),
    }


def _first_chunk(plan: Plan) -> np.ndarray:
    """(n, k) the starts of the first chunk."""
    return plan.sampler(np.arange(min(plan.samples, plan.chunk)), plan.seed)
