"""Exhibits: pages of the site that show what the library does beyond the course.

A page consists of one or more parts, which run separately. Each returns a record: ``title``,
``text`` in Markdown, ``drawings``, ``tables``, ``cases`` (hard cases, by topic) and ``minis``
(animated orbits, each an initial state for the program ``model``).
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
    """The cost of digits for three scenes of different kinds."""
    chosen = {
        "three_body": scenes.three_body(),
        "double_pendulum": scenes.double_pendulum(t1=5.0),
        "lorenz": scenes.lorenz(t1=5.0),
    }
    found = {
        name: work_precision(scene, rounds=10, options=FULLY) for name, scene in chosen.items()
    }
    look = (
        "The error of the final state against the time of a solve; lower and further left is "
        "better. Taylor series do not evaluate right-hand sides."
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
        "Errors are relative to a solution at the limit of double precision; times are medians of "
        "ten compiled solves. `jaxdyn accuracy SCENE` does the same for any scene, and recommends "
        "a method and a tolerance."
    )
    tables = [{"title": "The fastest method for each scene", "head": head, "rows": rows}]
    return {"title": "The cost of digits", "text": text, "drawings": drawings, "tables": tables}


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
        "These scenes break naive codes. A case holds if each of its figures stays within its "
        "bound. The figures compare results with closed forms, with independent computations or "
        "with numbers of high precision. `jaxdyn hard` runs the cases."
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
    """A family of orbits, a bifurcation diagram, a stability chart, a section, a manifold."""
    shown = {
        "family_pendulum": (
            _swings(),
            "Oscillations of a pendulum: the period grows with the energy, and becomes infinite at "
            "m g l = 9.81 J, where the pendulum comes to rest upright.",
        ),
        "diagram_lorenz": (
            _diagram(),
            "The Lorenz equations: at rho = 1 the origin loses its stability to two equilibria. "
            "These lose theirs at rho = 24.74, where unstable orbits shrink onto them. For smaller "
            "rho the orbits are larger, until they reach the origin at rho = 13.93.",
        ),
        "chart_upright": (
            _chart(),
            "The region in which a stick stands upright on a vertically shaken base: the shaking "
            "must be fast enough, and its amplitude not too large.",
        ),
        "section_henon_heiles": (
            _section(),
            "The Henon-Heiles system at E = 1/8, in the section x = 0: islands of regular motion "
            "in a chaotic sea.",
        ),
        "manifold_l1": (
            _manifold(),
            "The unstable manifold of an orbit about L1 of the Sun and Jupiter, in axes that "
            "rotate with them: to the left motions go inwards; to the right they pass Jupiter, "
            "and some of them escape outwards. The comet Oterma moved on such a path.",
        ),
    }
    text = (
        "`orbits.continue_family` follows an orbit and detects bifurcations, `orbits.diagram` also "
        "follows the branches, and Floquet multipliers decide stability. `orbits.section` computes "
        "a surface of section from many starts, `orbits.manifold` the motions that leave an orbit."
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
      timed: whether it runs for longer than it compiles, or is timed, and so needs all of XLA's
        optimisations.
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


_LONG = {"bodies", "chaos", "drift", "long"}  # hard cases that run for longer than they compile
#: All parts by name, in the order of the pages.
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
    """The record of a page: the contents of its parts, with the title and text of the first."""
    lists = {
        what: [one for part in parts for one in part.get(what, ())]
        for what in ("drawings", "tables", "cases", "minis")
    }
    holds = all(part.get("holds", True) for part in parts)
    whole = {"holds": holds, "model": "".join(part.get("model", "") for part in parts)}
    return {"title": parts[0]["title"], "text": parts[0]["text"], **whole, **lists}
