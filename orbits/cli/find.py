"""The command `orbits find`: a periodic orbit of any scene of the catalogue."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

import jaxdyn
import orbits
from jaxdyn import _text
from jaxdyn._text import choice, fail
from jaxdyn.cli.docstrings import scene_settings
from jaxdyn.cli.screen import screen
from jaxdyn.cli.shared import (
    AnimateOption,
    JsonOption,
    PlotOption,
    SceneArgument,
    SetOption,
    TitleOption,
    check_title,
    number,
)
from orbits.cli.printed import print_reports
from orbits.cli.shared import SaveOption, draw, not_found, printer

_CLOSINGS = ("plain", "choreography", "relative", "reversal")

_ELSEWHERE = "Start elsewhere with --set, or give another --period."
#: Remedies in terms of the options, by the name of the outcome, where `_ELSEWHERE` is not enough.
_REMEDIES = {
    "ITERATION_LIMIT": "Give a start with --set and a --period that are closer, or --rough.",
    "NO_DESCENT": "Give a start with --set and a --period that are closer, --rough, more "
    "--segments, or --hold what distinguishes the orbit from its family.",
    "ESCAPE": f"{_ELSEWHERE} --hold and --energy keep the search near.",
    "TRIVIAL": "Give the --period of the orbit, or --hold an entry or --energy.",
    "STEP_LIMIT": "Give a shorter --period: `jaxdyn run` shows how often the motion turns. "
    "A stiff scene needs --collocation.",
    "DESCENT_ENDED": f"{_ELSEWHERE} Without --rough Newton's method starts from the guess itself.",
    "MESH_LIMIT": "Give a start with --set and a --period that are closer, or --shooting.",
    "NO_OTHER": f"{_ELSEWHERE} In a conservative scene hold the --energy.",
    "UNCONFIRMED": "The rate is not smooth, or changes too fast for the steps. In Python, find "
    "takes a smaller rtol, and orbits.hybrid finds orbits of motions with corners.",
    "TIME_LIMIT": "Give a start with --set and a --period that are closer. In Python, find takes "
    "a longer time.",
}

_MeshOption = Annotated[
    bool | None,
    typer.Option(
        "--collocation/--shooting",
        help="Solve on an adaptive mesh, for stiff or very unstable orbits; by default where "
        "shooting fails and the guess is stiff.",
    ),
]

_UnlikeOption = Annotated[
    list[Path] | None,
    typer.Option(metavar="FILE", help="Find an orbit other than that of a file; repeatable."),
]


def find_command(
    name: SceneArgument,
    settings: SetOption = None,
    period: Annotated[
        float | None, number("Guess; by default that of a forcing, or a close return.")
    ] = None,
    closing: Annotated[
        str, typer.Option(metavar="NAME", help=f"{', '.join(_CLOSINGS[:-1])} or {_CLOSINGS[-1]}.")
    ] = "plain",
    energy: Annotated[float | None, number("Energy of the orbit.")] = None,
    hold: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Entry of the initial state to keep fixed; repeatable."),
    ] = None,
    segments: Annotated[int | None, typer.Option(help="Number of segments of the motion.")] = None,
    rough: Annotated[
        bool, typer.Option("--rough", help="Minimise the closing error before Newton's method.")
    ] = False,
    collocation: _MeshOption = None,
    unlike: _UnlikeOption = None,
    plot: PlotOption = None,
    title: TitleOption = None,
    animate: AnimateOption = None,
    save_to: SaveOption = None,
    as_object: JsonOption = False,
) -> None:
    """A periodic orbit near a scene's own motion, with its invariants and its stability."""
    check_title(title, plot)
    choice("--closing", closing, _CLOSINGS)
    chosen = scene_settings(name, settings)
    with screen(f"looking for an orbit of {name}", as_object) as out:
        scene = jaxdyn.scenes.catalogue.build_smooth(name, chosen)
        orbit = orbits.discovery.nearby.search_near(
            scene,
            period,
            closing=_closings(scene, closing),
            energy=energy,
            hold=hold or (),
            segments=segments,
            strategy=_strategy(rough, collocation, unlike or (), scene),
            report=printer(out),
            throw=False,
        )
        if not orbit.ok:
            raise not_found(orbit, _remedy(orbit, scene, closing), {}, as_object, out)
        jaxdyn.scenes.corners.check_one_phase(orbit.scene.starting(orbit.y0), orbit.period)
        out.show_task(f"testing the orbit of {name}: stability, a second integrator")
        claims = orbits.report(orbit)
        if as_object:
            record = {"scene": name, "start_moved": orbit.shift}
            out.result(record | orbits.analysis.as_json(claims))
        else:
            print_reports({f"{name}, {orbit.closing.name}": claims}, out, orbit)
        starts = _text.entries(scene.labels(), orbit.y0, digits=12, most=len(orbit.y0))
        out.print(escape(f"start: {starts}"))
        out.print(f"  moved by {orbit.shift:.1e} from the start of the search")
        if save_to:
            with out.writing(save_to, "saved to"):
                orbits.save(save_to, orbit, claims)
        found = f"period {orbit.period:.9g}, {claims.verdict}"
        draw([orbit], [found], plot, animate, out, title)


def _strategy(
    rough: bool,
    collocation: bool | None,
    unlike: "Sequence[Path]",
    scene: "jaxdyn.Scene",
) -> "orbits.shooting.strategy.Strategy":
    """The strategy that the flags ask for."""
    flags = {"--rough": rough, "--collocation": collocation, "--unlike": unlike}
    given = [flag for flag, there in flags.items() if there]
    if len(given) > 1:
        raise fail("find", f"one of {', '.join(flags)}", " and ".join(given))
    if unlike:
        return orbits.Deflated([orbits.load(file, scene=scene)[0] for file in unlike])
    if collocation:
        return orbits.Collocation()
    first = orbits.Descent() if rough else orbits.Shooting()
    return orbits.shooting.multiple.Automatic(first) if collocation is None else first


def _remedy(orbit: "orbits.Orbit", scene: "jaxdyn.Scene", closing: str) -> str:
    remedy = _REMEDIES.get(orbit.outcome.name, _ELSEWHERE)
    symmetric = "" if closing != "plain" else orbits.closing.symmetric_closing(scene)
    if not symmetric:
        return remedy
    option = "--closing reversal" if "time_reversal" in symmetric else f"in Python, {symmetric}"
    return (
        f"{remedy} The start is symmetric: {option} needs half of the period and of the unknowns."
    )


def _closings(
    scene: "jaxdyn.Scene", name: str
) -> "orbits.closing.Closing | Sequence[orbits.closing.Closing]":
    """The closing that `--closing` names; for a choreography several, to choose from."""
    system = scene.system
    if name == "choreography":
        if not isinstance(system, jaxdyn.formulations.newton.FreePoints):
            raise fail("--closing", "one for this scene", name, "Only free points can satisfy it.")
        return orbits.choreography(len(system.m), system.d)
    if name == "relative":
        turns = [key for key in system.generators(scene.y0) if key.startswith("turn")]
        if not turns:
            raise fail("--closing", "one for this scene", name, "Its state has no rotation.")
        return orbits.relative(turns[0])
    if name == "reversal":
        return orbits.reversal(orbits.time_reversal(len(scene.y0)))
    return orbits.PLAIN
