"""A picture of entries of the state, and of energies, against time."""

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from matplotlib.figure import Figure

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn._text import name_of, second, with_unit
from jaxdyn.analysis.energy import NAMES, energies
from jaxdyn.drawing.contents import why_stopped
from jaxdyn.drawing.curves import quantities, samples_reached, states
from jaxdyn.drawing.figures import GRID, PALETTE, blank, finish, style
from jaxdyn.drawing.panels import WIDTH
from jaxdyn.drawing.titles import heading
from jaxdyn.files.output_files import picture_path
from jaxdyn.integrate.phases import HybridTrajectory, pieces_of
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scene import Scene
from jaxdyn.system import check_value
from jaxdyn.vibration.forcing import driving
from jaxdyn.vibration.signals import Signal

_ENERGIES = "energy"  # the panel of all energies


@check_first
def time_series(
    motion: Trajectory | HybridTrajectory,
    path=None,
    *,
    names: Sequence[str | Callable] | None = None,
    title: str | None = None,
) -> Figure:
    """A picture of entries of the state, of energies, and of functions, against time.

    There is one panel per unit, and one for each function.

    Args:
      motion: result of `simulate` or `simulate_phases`. Curves are smooth, see `curves`; phases are
        separated by lines.
      path: file to write, .png, .pdf or .svg.
      names: what to draw, the entries of the state by default: their labels, and "kinetic",
        "potential" and "total" for energies, e.g. ``["x", "vx", "kinetic", "potential"]``; and
        what drives the scene, see `vibration.drive`: "force on x", "displacement" of a road; and
        functions (t, y) -> (), such as an acceleration, ``lambda t, y: scene.rate(t, y)[2]``.
      title: title of the picture; by default the scene with its numbers, "" for none.
    Raises:
      ValueError: `names` has an unknown label, an energy or an input that the scene does not have,
        or a function of another kind, or with the name of another; `motion` is a batch, or `path`
        cannot be written.
    """
    path = picture_path(path)
    pieces = pieces_of(motion)
    scene = pieces[0].scene
    entries = dict(scene.labels())
    functions = _functions(scene, names or (), entries)
    names = list(entries) if names is None else names
    names = [name_of(x, "quantity") if callable(x) else x for x in names]
    panel_of = _panels(scene, names) | {name: name for name in functions}
    names = [_checks.choice("names", x, panel_of) for x in names]
    if not names:
        raise _checks.fail("names", "one of " + ", ".join(panel_of), "none")
    parts = [_values(piece, len(pieces), names, functions) for piece in pieces]
    ts, drawn = (np.concatenate(both) for both in zip(*parts, strict=True))
    values = dict(zip(names, drawn.T, strict=True))
    shown = list(dict.fromkeys(panel_of[name] for name in names))
    plain = all(unit == "1" for unit in entries.values())
    lines = heading(title, [scene], WIDTH, why_stopped(motion))
    figure = blank(WIDTH, 0.8 + 2.1 * len(shown))
    axes = figure.subplots(len(shown), sharex=True, squeeze=False)[:, 0]
    for ax, panel in zip(axes, shown, strict=True):
        style(ax)
        for begin in (part[0][0] for part in parts[1:] if len(part[0])):
            ax.axvline(begin, color=GRID, lw=1.6, zorder=1)
        for i, name in enumerate(x for x in names if panel_of[x] == panel):
            dash = ("-", "--", ":")[i // len(PALETTE) % 3]
            ax.plot(ts, values[name], dash, color=PALETTE[i % len(PALETTE)], lw=1.6, label=name)
        ax.margins(x=0)
        first = next(x for x in names if panel_of[x] == panel)
        ax.set_ylabel(_of_panel(scene, first, panel))
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    axes[-1].set_xlabel("t" if plain else f"t [{second(scene.labels())}]")
    axes[0].set_title(lines, fontsize=10)
    return finish(figure, path)


def _functions(scene: Scene, names: Sequence, entries: dict) -> dict[str, Callable]:
    """The functions among the quantities to draw, by their names, which differ."""
    found: dict[str, Callable] = {}
    for function in filter(callable, names):
        name = name_of(function, "quantity")
        _checks.check_callable("names", function, "t", "y")
        check_value("names", (), "One number.", function, jnp.zeros(()), scene.y0)
        if name in entries or found.setdefault(name, function) is not function:
            remedy = "Define them by `def`, with names of their own."
            raise _checks.fail("names", "functions with different names", f"two {name!r}", remedy)
    return found


def _panels(scene: Scene, names: Sequence[str]) -> dict[str, str]:
    """The panel of each quantity by name; raises for the name of an energy if there is none.

    The panel of an entry is the unit that the system gives it, so that positions and velocities
    have separate panels even in a scene without units.
    """
    labels = dict(scene.system.labels())
    asked = {*NAMES} & {*names} - {*labels}
    known = jax.eval_shape(_energies, scene) if scene.has_energy or asked else ()
    inputs = {name: one.unit or name for name, one in driving(scene).items()}
    return dict.fromkeys(known, _ENERGIES) | inputs | labels


def _of_panel(scene: Scene, name: str, panel: str) -> str:
    """The label of the panel of a quantity: its unit, or "" if it has none."""
    entries, inputs = dict(scene.labels()), driving(scene)
    if name == panel:  # of a function
        return ""
    if name not in entries and panel == _ENERGIES:
        return with_unit("energy", scene.in_units("J"))
    unit = entries[name] if name in entries else inputs[name].unit
    return with_unit("", unit).strip()


def _values(
    piece: Trajectory, pieces: int, names: Sequence[str], functions: dict[str, Callable]
) -> tuple[np.ndarray, np.ndarray]:
    """Times (s,) of a smooth curve, and the values (s, n) of the named quantities there."""
    count = samples_reached(piece)
    ts, ys = states(piece, count, pieces)
    found = dict(zip(dict(piece.scene.labels()), ys.T, strict=True))
    inputs = driving(piece.scene)
    found = {name: _along(inputs[name].signal, ts) for name in names if name in inputs} | found
    for name, function in functions.items():
        found[name] = np.asarray(jax.vmap(function)(jnp.asarray(ts), jnp.asarray(ys)))
    if not set(names) <= set(found):
        found = quantities(piece, count, pieces, energies) | found
    return ts, np.stack([found[name] for name in names], axis=1)


@jax.jit
def _along(signal: Signal, ts: Array) -> Array:
    return jax.vmap(signal)(ts)


def _energies(scene: Scene) -> dict[str, Array]:
    return energies(scene, jnp.zeros(()), scene.y0)
