"""The command `jaxdyn accuracy`: the cost of each digit for a scene."""

import math
from typing import Annotated

import jaxdyn
from jaxdyn._text import check_digits
from jaxdyn.cli.docstrings import scene_settings
from jaxdyn.cli.screen import Screen, screen
from jaxdyn.cli.shared import (
    JsonOption,
    PlotOption,
    SceneArgument,
    SetOption,
    SpanOption,
    TitleOption,
    check_title,
    number,
)

_SHOWN = (3, 6, 9, 12, 14)


def accuracy_command(
    name: SceneArgument,
    settings: SetOption = None,
    t1: SpanOption = None,
    digits: Annotated[float, number("Digits for which to recommend a solver.")] = 9,
    plot: PlotOption = None,
    title: TitleOption = None,
    as_object: JsonOption = False,
) -> None:
    """The time that each digit costs; a solver and a tolerance for the requested digits."""
    check_title(title, plot)
    check_digits(digits)
    chosen = scene_settings(name, settings)
    with screen(f"solving {name} as exactly as possible", as_object) as out:
        scene = jaxdyn.scenes.catalogue.build_smooth(name, chosen, t1)
        found = jaxdyn.accuracy.work_precision.work_precision(scene, t1)
        method, why = (
            jaxdyn.solvers.choice.default_solver(scene),
            jaxdyn.solvers.choice.reason(scene),
        )
        if jaxdyn.solvers.RADAU9.name in {curve.solver for curve in found.curves}:
            why += "; the scene is stiff: Radau 9 takes over after 1000 steps limited by stability"
        if as_object:
            default = {"default": method.name, "reason": why}
            out.result({"scene": name} | default | found.as_dict() | _recommendation(found, digits))
        else:
            _print(name, found, digits, out)
            rtol = jaxdyn.solvers.choice.RTOL
            out.print(f"the default at rtol {rtol:g} is {method.name}, since {why}")
        if plot:
            with out.writing(plot, "drawn in"):
                jaxdyn.drawing.work_precision(found, plot, title=title or name)


def _recommendation(found: "jaxdyn.accuracy.work_precision.WorkPrecision", digits: float) -> dict:
    choice = found.recommend(digits)
    return {"digits": digits, "recommended": choice and choice._asdict()}


def _print(
    name: str, found: "jaxdyn.accuracy.work_precision.WorkPrecision", digits: float, out: Screen
) -> None:
    out.print(f"[bold]{name}[/bold]: time for each number of correct digits ({found.quantity})")
    for n in _SHOWN:
        times = {solver: t.median for solver, t in found.at(10.0**-n).items()}
        reached = {solver: s for solver, s in times.items() if not math.isnan(s)}
        if not reached:
            out.print(f"  {n:2} digits: not reached")
            continue
        best = min(reached, key=reached.__getitem__)
        others = ", ".join(f"{s}: {_time(x)}" for s, x in reached.items() if s != best)
        more = f" ({others})" if others else ""
        out.print(f"  {n:2} digits: {_time(reached[best])} with {best}{more}")
    compiling = ", ".join(f"{c.solver}: {c.compiling:.1f} s" for c in found.curves)
    out.print(f"compilation, only once: {compiling}")
    choice = found.recommend(digits)
    if choice:
        adaptive = next(c.adaptive for c in found.curves if c.solver == choice.solver)
        at = f"rtol {choice.fineness:.0e}" if adaptive else f"steps of {choice.fineness:.3g}"
        out.print(
            f"recommended for {digits:g} digits: {choice.solver} with {at}, which takes "
            f"{_time(choice.seconds)}; its relative error is {choice.error:.1e}"
        )
        return
    best = min((r.error for c in found.curves for r in c.rungs), default=math.nan)
    out.print(
        f"{digits:g} digits cannot be reached: the smallest relative error is {best:.1e}. "
        "A shorter span, --t1, may help."
    )


def _time(seconds: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e6:.3g} us"
