"""The command `orbits aim`: the best launch angle of a ball with drag, and how to hit a target."""

import math
from typing import Annotated

import typer

import jaxdyn
import orbits
from jaxdyn._text import brief
from jaxdyn.cli.screen import Screen, screen
from jaxdyn.cli.shared import JsonOption, PlotOption, TitleOption, check_title, number
from orbits.cli.shared import NOT_FOUND


def aim_command(
    speed: Annotated[float, number("Launch speed [m/s].")] = 10.0,
    x: Annotated[float | None, number("Target on the ground [m].")] = None,
    height: Annotated[float, number("Height of the launch above the ground [m].")] = 0.0,
    g: Annotated[float, number("Gravity [m/s^2].")] = 9.81,
    mass: Annotated[float, number("Mass [kg].")] = 1.0,
    drag: Annotated[float, number("Quadratic drag [kg/m].")] = 0.0,
    linear: Annotated[float, number("Linear drag [kg/s].")] = 0.0,
    wind: Annotated[float, number("Wind along x [m/s].")] = 0.0,
    plot: PlotOption = None,
    title: TitleOption = None,
    as_object: JsonOption = False,
) -> None:
    """The launch angle of the longest throw; with --x, those that hit, and the lowest speed."""
    check_title(title, plot)
    with screen("looking for the angle of the longest throw", as_object) as out:
        scene = jaxdyn.scenes.cannonball(m=mass, g=g)
        if drag:
            scene = scene + jaxdyn.effects.QuadraticDrag(drag, (wind, 0.0))
        if linear:
            scene = scene + jaxdyn.effects.LinearDrag(linear, (wind, 0.0))
        # Print each line as soon as it is known: compiling takes a while.
        best = orbits.targets.aim.farthest(scene, speed, height)
        out.print(_line("farthest", best))
        hits = least = None
        if x is not None:
            out.show_task(f"looking for the angles that hit {x:g} m")
            hits = orbits.targets.aim.hit(scene, x, speed, height)
            _print_hits(hits, out)
            if x > 0:
                out.show_task(f"looking for the lowest speed that reaches {x:g} m")
                least = orbits.targets.aim.slowest(scene, x, height)
                out.print(_line("least speed", least))
        if as_object:
            found = {"farthest": _throw(best), "hits": _hits(hits)}
            out.result(found | {"slowest": least and _throw(least)})
        if plot:
            with out.writing(plot, "drawn in"):
                orbits.drawing.throws(scene, best, hits, plot, title=title)
        if not (best.ok if hits is None else hits.ok):
            raise typer.Exit(NOT_FOUND)


def _print_hits(hits: "orbits.targets.aim.Hits", out: Screen) -> None:
    if not hits.ok:
        out.print(f"[red]not hit[/red]: {hits.message}")
    for angle, t in zip(hits.angles, hits.times, strict=True):
        degrees = brief(math.degrees(angle), "degrees", digits=12)
        out.print(f"hits {hits.x:.6g} m at {degrees} in {t:.8g} s")


def _line(name: str, throw: "orbits.targets.aim.Throws") -> str:
    if not throw.ok:
        return f"{name}: {throw.message}"
    angle = brief(math.degrees(throw.angle), "degrees", digits=12)
    return f"{name}: {throw.speed:.10g} m/s at {angle} lands at {throw.x:.10g} m in {throw.t:.8g} s"


def _throw(throw: "orbits.targets.aim.Throws") -> dict:
    numbers = {name: float(getattr(throw, name)) for name in ("speed", "angle", "x", "t")}
    return {"ok": throw.ok, "message": throw.message, **numbers}


def _hits(hits: "orbits.targets.aim.Hits | None") -> dict | None:
    if hits is None:
        return None
    found = {"ok": hits.ok, "message": hits.message, "x": hits.x}
    found |= {"angles": hits.angles.tolist(), "times": hits.times.tolist()}
    return found | {"short": float(hits.short), "nearest": float(hits.nearest)}
