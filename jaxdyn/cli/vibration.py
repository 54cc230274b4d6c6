"""The command `jaxdyn vibration`: natural modes, and a frequency response."""

import math
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

import jaxdyn
from jaxdyn._text import brief, entries, fail, frequency_scale, second, whole, with_unit
from jaxdyn.cli.docstrings import scene_settings
from jaxdyn.cli.screen import Screen, screen
from jaxdyn.cli.shared import (
    HertzOption,
    JsonOption,
    PlotOption,
    SceneArgument,
    SetOption,
    TitleOption,
    check_title,
    numbers,
    output_option,
)
from jaxdyn.files.output_files import table_path

#: Rounds in which the largest receptance is located, and frequencies tried in each after the first.
_REFINEMENTS, _FINER = 4, 101

NearOption = Annotated[
    str | None,
    typer.Option(
        "--start", metavar="A,B,..", help="A state near the equilibrium; the scene's start."
    ),
]


def vibration_command(
    name: SceneArgument,
    settings: SetOption = None,
    start: NearOption = None,
    given: Annotated[
        str | None,
        typer.Option("--input", metavar="NAME", help="Coordinate on which it acts."),
    ] = None,
    output: Annotated[
        str | None, typer.Option(metavar="NAME", help="Entry of the response; that of --input.")
    ] = None,
    within: Annotated[
        str | None, typer.Option(metavar="A,B", help="Frequencies of the response [rad/s].")
    ] = None,
    samples: Annotated[int, typer.Option(help="Number of frequencies.")] = 400,
    plot: PlotOption = None,
    csv: Annotated[Path | None, output_option(table_path, "Write the response (.csv).")] = None,
    hertz: HertzOption = False,
    title: TitleOption = None,
    as_object: JsonOption = False,
) -> None:
    """Natural frequencies, damping ratios and mode shapes of a scene about an equilibrium.

    With --input, also the receptance: the displacement of --output per unit of force.
    """
    check_title(title, plot)
    whole("samples", samples, least=2)
    if given is None and (output, within, plot, csv) != (None,) * 4:
        raise fail("--input", "a coordinate", "none", "It says where the force acts.")
    with screen(f"linearising {name}", as_object) as out:
        scene = jaxdyn.scenes.catalogue.build(name, scene_settings(name, settings))
        if jaxdyn.plan.plan_of(scene.field, len(scene.y0)).depends_on_time:
            wanted, remedy = "one that does not depend on time", "`orbits find` finds its motions."
            raise fail("scene", wanted, name, remedy)
        scene = at_equilibrium(scene, start)
        found = jaxdyn.vibration.modes(scene)
        if as_object:
            out.result({"scene": name} | _as_json(found, scene))
        else:
            _print(name, found, scene, out)
        if given is not None:
            options = (given, output or given, within, samples, hertz)
            _response(scene, options, (plot, csv, title), out)


def at_equilibrium(scene: "jaxdyn.Scene", start: str | None) -> "jaxdyn.Scene":
    """The scene at the equilibrium near a state A,B,..., or near its own initial state."""
    near = scene.y0.tolist() if start is None else numbers("--start", start)
    found = jaxdyn.analysis.equilibria.equilibrium(scene, near).tolist()
    if not all(map(math.isfinite, found)):
        came = "the start of the scene" if start is None else start
        raise fail("--start", "a state near an equilibrium", f"{came}, near which none was found")
    return scene.starting(found)


def _print(
    name: str, found: "jaxdyn.vibration.NaturalModes", scene: "jaxdyn.Scene", out: Screen
) -> None:
    names = [label for label, _ in scene.labels()]
    unit = second(scene.labels())
    place = entries(scene.labels(), scene.y0, most=len(scene.y0))
    out.print(f"[bold]{escape(name)}[/bold] about {escape(place)}")
    kinds = (False, True) if unit else (False,)
    scales = [frequency_scale(unit, hertz=hertz) for hertz in kinds]
    heads = [*(with_unit("frequency", name) for _, name in scales), "damping ratio"]
    grows = any(x.imag == 0 and x.real != 0 for x in found.eigenvalues.tolist())
    heads += [with_unit("growth rate", f"1/{unit}" if unit else "")] * grows
    table = Table("mode", *map(escape, heads))
    shapes = found.shapes
    for label in names[: len(shapes)]:
        table.add_column(escape(label))
    ratios = found.damping_ratios.tolist()
    rows = zip(found.eigenvalues.tolist(), ratios, shapes.T, strict=True)
    for number, (value, ratio, shape) in enumerate(rows, start=1):
        # A real eigenvalue is a rate, neither a frequency nor a damping ratio.
        turns = bool(value.imag) or not value
        texts = [brief(abs(value) * scale) if turns else "" for scale, _ in scales]
        texts += [brief(ratio) if value.imag else "", *[brief(value.real + 0.0)] * grows]
        texts += [brief(float(abs(x) * (1 if x.real >= 0 else -1))) for x in shape]
        table.add_row(str(number), *texts)
    out.print(table)


def _as_json(found: "jaxdyn.vibration.NaturalModes", scene: "jaxdyn.Scene") -> dict:
    ratios = [x + 0.0 if math.isfinite(x) else None for x in found.damping_ratios.tolist()]
    return {
        "equilibrium": scene.y0.tolist(),
        "eigenvalues": [[x.real, x.imag] for x in found.eigenvalues.tolist()],
        "frequencies": found.frequencies.tolist(),
        "damping_ratios": ratios,
        "shapes": [[[x.real, x.imag] for x in shape] for shape in found.shapes.T.tolist()],
    }


def _response(scene: "jaxdyn.Scene", options: tuple, files: tuple, out: Screen) -> None:
    """The response from an input to an output, drawn and written."""
    given, output, within, samples, hertz = options
    plot, csv, title = files
    low, high = _range(within, scene, hertz)
    ratio = (high / low) ** (1 / (samples - 1))
    omega = [low * ratio**i for i in range(samples)]
    found = jaxdyn.vibration.transfer_function(scene, given, output)
    size, at = _largest(scene, found, omega)
    scale, unit = frequency_scale(found.time, hertz=hertz)
    peak = f"{brief(size, found.unit)} at {brief(at * scale, unit)}"
    out.print(escape(f"largest receptance, {found.name}: {peak}"))
    if plot:
        with out.writing(plot, "drawn in"):
            jaxdyn.drawing.bode(omega, found, plot, hertz=hertz, title=title)
    if csv:
        with out.writing(csv, "written to"):
            jaxdyn.files.tables.write_labelled(csv, found.table(omega, hertz=hertz))


def _largest(
    scene: "jaxdyn.Scene", found: "jaxdyn.vibration.TransferFunction", omega: list[float]
) -> tuple[float, float]:
    """The largest receptance between the first and the last frequency, and its frequency.

    Resonances may be narrower than the distance of the samples, so natural frequencies are tried as
    well; the neighbourhood of the largest value is then sampled again and again.
    """
    natural = jaxdyn.vibration.modes(scene).frequencies.tolist()
    tried = sorted([*omega, *(w for w in natural if omega[0] < w < omega[-1])])
    best = (0.0, omega[0])
    for _ in range(_REFINEMENTS):
        sizes = [abs(x) for x in found.at(tried).tolist()]
        top = max(range(len(tried)), key=sizes.__getitem__)
        best = max(best, (sizes[top], tried[top]))
        low, high = tried[max(top - 1, 0)], tried[min(top + 1, len(tried) - 1)]
        tried = [low + (high - low) * i / (_FINER - 1) for i in range(_FINER)]
    return best


def _range(within: str | None, scene: "jaxdyn.Scene", hertz: bool) -> tuple[float, float]:
    if within is None:
        found = [w for w in jaxdyn.vibration.modes(scene).frequencies.tolist() if w > 0]
        return 0.1 * min(found, default=1.0), 10 * max(found, default=1.0)
    bounds = numbers("--within", within)
    if not (len(bounds) == 2 and 0 < bounds[0] < bounds[1]):
        raise fail("--within", "two frequencies > 0, the lower one first", repr(within))
    scale, _ = frequency_scale(second(scene.labels()), hertz=hertz)
    return bounds[0] / scale, bounds[1] / scale
