"""Exhibits: pages of the site that show what the library does beyond the course.

A page consists of one or more parts, which run apart. Each returns a record: ``title``, ``text`` in
Markdown, ``drawings``, ``tables``, ``cases`` (hard ones, by topic) and ``minis`` (orbits that move,
each a start of the program ``model``).
"""

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import orbits
from jaxdyn import drawing, hard, integrate, scenes
from jaxdyn.accuracy.work_precision import work_precision
from jaxdyn.gallery import poster
from jaxdyn.gallery.compiling import FULLY
from jaxdyn.gallery.pictures import write
from jaxdyn.gallery.texts import duration
from jaxdyn.hard.cases import shaken
from orbits.drawing import diagram as diagram_picture
from orbits.drawing import family as family_picture
from orbits.drawing import manifold as manifold_picture
from orbits.drawing import section as section_picture
from orbits.files.family_files import listing


def accuracy(pictures: Path) -> dict[str, Any]:
    """What digits cost, for three scenes of different kinds."""
    chosen = {
        "three_body": scenes.three_body(),
        "double_pendulum": scenes.double_pendulum(t1=5.0),
        "lorenz": scenes.lorenz(t1=5.0),
    }
    found = {
        name: work_precision(scene, rounds=10, options=FULLY) for name, scene in chosen.items()
    }
    look = (
        "The error of the end against the time of a solve: down and to the left is better. "
        "Taylor series evaluate no right-hand sides."
    )
    solvers = [curve.solver for one in found.values() for curve in one.curves]
    drawings = [
        write(
            drawing.work_precision(one, title=name, solvers=solvers),
            pictures,
            f"accuracy_{name}",
            look,
        )
        for name, one in found.items()
    ]
    rows = [
        [name, str(n), *_best(one.at(10.0**-n))]
        for name, one in found.items()
        for n in (3, 6, 9, 12)
    ]
    head = ["scene", "digits", "fastest", "time"]
    text = (
        "Errors are against a solution at the limit of double precision; times are of compiled "
        "solves, the median of ten. `jaxdyn accuracy SCENE` does the same for any scene and "
        "recommends a method and a tolerance."
    )
    tables = [{"title": "The fastest method for each scene", "head": head, "rows": rows}]
    return {"title": "What digits cost", "text": text, "drawings": drawings, "tables": tables}


def _best(times: dict) -> list[str]:
    """The fastest solver and its time, as text."""
    reached = {name: one.median for name, one in times.items() if np.isfinite(one.median)}
    if not reached:
        return ["not reached", ""]
    name = min(reached, key=reached.__getitem__)
    return [name, duration(reached[name])]


def hard_cases(names: Sequence[str], topic: str, _pictures: Path) -> dict[str, Any]:
    """The verdicts of the hard cases of one topic."""
    verdicts = [hard.judge(case) for case in hard.collection.chosen(names)]
    cases = [
        {
            "name": verdict.case.name,
            "what": verdict.case.holds,
            "holds": verdict.passed,
            "seconds": f"{verdict.seconds:.1f}",
            "figures": [_figure(figure) for figure in verdict.figures],
        }
        for verdict in verdicts
    ]
    text = (
        "Scenes that break naive codes. A case holds if each of its figures stays within its "
        "bound; they come from closed forms, from other routes or from numbers of high "
        "precision. `jaxdyn hard` runs them."
    )
    return {
        "title": "Hard cases",
        "text": text,
        "cases": [{"topic": topic, "cases": cases}],
        "holds": all(verdict.passed for verdict in verdicts),
    }


def _figure(figure: hard.Figure) -> dict[str, str]:
    """A figure of a hard case, as text."""
    return {
        "what": figure.what,
        "value": f"{figure.value:.3g}" if np.isfinite(figure.value) else "not reached",
        "bound": "" if figure.bound is None else f"at most {figure.bound:g}",
    }


def families(pictures: Path) -> dict[str, Any]:
    """A family of orbits, a diagram, a chart of stability, a section, a manifold."""
    shown = {
        "family_pendulum": (
            _swings(),
            "Swings of a pendulum: the period grows with the energy, without limit at m g l = "
            "9.81 J, where it comes to rest upright.",
        ),
        "diagram_lorenz": (
            _diagram(),
            "Lorenz's equations: at rho = 1 the origin loses its stability to two equilibria. "
            "These lose theirs at rho = 24.74, where unstable orbits shrink onto them; below, the "
            "orbits grow until they reach the origin, at rho = 13.93.",
        ),
        "chart_upright": (
            _chart(),
            "Where a stick stands upright on a base that shakes up and down: the shaking must be "
            "fast enough, and not too wide.",
        ),
        "section_henon_heiles": (
            _section(),
            "The system of Henon and Heiles at E = 1/8, crossed at x = 0: islands of regular "
            "motion in a chaotic sea.",
        ),
        "manifold_l1": (
            _manifold(),
            "What leaves an orbit at L1 of the Sun and Jupiter, in axes that turn with them: "
            "inwards to the left; to the right past Jupiter, of which some motions get out. The "
            "comet Oterma moved on such a path.",
        ),
    }
    text = (
        "`orbits.continue_family` follows an orbit and detects what happens on the way, "
        "`orbits.diagram` all that branches off, Floquet multipliers decide what is stable, "
        "`orbits.section` crosses a plane from many starts, `orbits.manifold` follows what leaves "
        "an orbit."
    )
    drawings = [write(figure, pictures, name, look) for name, (figure, look) in shown.items()]
    return {"title": "Families, charts, sections", "text": text, "drawings": drawings}


def _swings():
    swing = orbits.find(scenes.pendulum(angle=0.5), period=2.1)
    swings = orbits.continue_family(swing, members=60)
    return family_picture(listing(swings), title="")


def _diagram():
    def lorenz(rho):
        return scenes.lorenz(rho=rho)

    found = orbits.diagram(lorenz, 0.5, [0.0, 0.0, 0.0], within=(0, 30))
    return diagram_picture(found, entry="x", parameter="rho")


def _chart():
    chart = shaken.upright_chart(np.linspace(0.02, 0.5, 80), np.linspace(5.0, 80.0, 80))
    return drawing.stability_chart(chart, names=("amplitude [m]", "frequency [rad/s]"))


def _section():
    scene, plane = scenes.henon_heiles(), integrate.events.Reaches(0, 0.0, 1)
    y, vy = np.linspace(-0.42, 0.66, 24), np.linspace(0.05, 0.48, 8)
    lines = {"y": np.concatenate([y, 0 * vy, 0 * vy]), "vy": np.concatenate([0 * y, vy, -vy])}
    starts = orbits.sections.complete(scene, plane, lines, energy=1 / 8)
    return section_picture(orbits.section(scene, plane, starts, crossings=400), title="")


def _manifold():
    scene = scenes.restricted_three_body(mu=0.0009537, x=0.92080349, vy=0.10445)
    orbit = orbits.find(scene, period=3.08, hold=[orbits.Energy(-1.5145236), "y"])
    return manifold_picture(orbits.manifold(orbit, "unstable", time=6.0), title="")


class Part(NamedTuple):
    """A part of an exhibit.

    Attributes:
      page: the name of the exhibit.
      make: returns its record; called with the folder of pictures.
      timed: it computes for longer than it compiles, or is timed: with all of XLA's optimisations.
    """

    page: str
    make: Callable[[Path], dict[str, Any]]
    timed: bool = False


def _hard_parts() -> dict[str, Part]:
    """The hard cases of each topic, those that take longest first."""
    parts = {}
    for topic in reversed(hard.collection.TOPICS):
        name = topic.__name__.rpartition(".")[2]
        title = str(topic.__doc__).partition("\n")[0].rstrip(".")
        make = functools.partial(hard_cases, [case.name for case in topic.CASES], title)
        parts[f"hard_{name}"] = Part("hard", make, timed=name in _LONG)
    return parts


_LONG = {"bodies", "chaos", "drift", "long"}  # hard cases that compute for longer than they compile
#: By name, a page after the other.
PARTS: dict[str, Part] = {
    "accuracy": Part("accuracy", accuracy, timed=True),
    "poster": Part("poster", poster.record, timed=True),
    "families": Part("families", families, timed=True),
    **_hard_parts(),
}
#: The names of the pages, each with those of its parts.
EXHIBITS: dict[str, list[str]] = {
    page: [name for name, part in PARTS.items() if part.page == page]
    for page in dict.fromkeys(part.page for part in PARTS.values())
}


def join(parts: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The record of a page: what its parts show, under the title and the text of the first."""
    lists = {
        what: [one for part in parts for one in part.get(what, ())]
        for what in ("drawings", "tables", "cases", "minis")
    }
    holds = all(part.get("holds", True) for part in parts)
    whole = {"holds": holds, "model": "".join(part.get("model", "") for part in parts)}
    return {"title": parts[0]["title"], "text": parts[0]["text"], **whole, **lists}
