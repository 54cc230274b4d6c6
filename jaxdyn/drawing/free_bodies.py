"""Free-body diagrams: every body of a scene cut free, with the forces on it as arrows.

The first panel shows the bodies together, with their pins and the ground; each of the others shows
one body alone. All arrows of a picture have one scale; forces too small for it are named with their
numbers. Space is seen from a fixed direction, with its axes drawn in the corner.
"""

import itertools
from typing import Any

import jax.numpy as jnp
import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.path import Path
from matplotlib.transforms import Bbox

from jaxdyn import _checks, _text
from jaxdyn._checks import check_kind
from jaxdyn._text import brief
from jaxdyn.analysis.free_body import BALANCE, Force, FreeBodies, FreeBody
from jaxdyn.analysis.free_body import free_body as cut_free
from jaxdyn.drawing.artists import BODY, GROUND, HUNG
from jaxdyn.drawing.figures import INK, PALETTE, blank, finish
from jaxdyn.drawing.strokes import coil, dashpot
from jaxdyn.drawing.titles import heading
from jaxdyn.files.output_files import picture_path
from jaxdyn.integrate.phases import HybridTrajectory, pieces_of
from jaxdyn.integrate.simulation import simulate
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scene import Scene
from jaxdyn.sketch import NAMED, Shape

_MOST_BODIES = 8
_PANEL = 3.3  # side of a panel [in]
_LINE, _TITLE_LINE = 0.155, 0.185  # inches per line of text
# A body alone is drawn in a square from -1.5 to 1.5.
_EDGE = 1.5
_BODY_SIZE = 0.5  # the largest distance of its corners from its mass centre
_LONGEST = 0.85  # length of the arrow of the largest force
_WHOLE_HEAD = 10.0  # arrows shorter than this have a smaller head [pt]
_SHORTEST = 0.03  # a shorter arrow is drawn as a dot with a name
_MOTION = ("#7a7a7a", "#8e6bbd")  # colours of velocity and acceleration
#: The directions right and up in a view of space from above, on the side of -y.
_VIEW = np.array([[0.8, 0.6, 0.0], [-0.3, 0.4, 0.75**0.5]])
_ALL_ROUND = 16  # number of directions, all around, in which a label is tried
_FAR = (0.08, 0.2, 0.34, 0.5)


def free_body(
    of: Scene | Trajectory | HybridTrajectory,
    t=0.0,
    y=None,
    path=None,
    *,
    motion: bool = False,
    title: str | None = None,
) -> Figure:
    """The free-body diagrams of a scene in a state, or of a motion at a time.

    The numbers are those of `analysis.free_body`, which finds by how much sum F = m a is violated;
    the picture shows this, too.

    Args:
      of: a scene, or the result of `simulate` or `simulate_phases`.
      t: () time [s].
      y: (k,) state of a scene, its start by default; not for a motion, which has its own.
      path: file to write, .png, .pdf or .svg.
      motion: whether velocity and acceleration of each mass centre are drawn, too.
      title: title of the picture; by default the scene with its numbers, "" for none.
    Returns:
      The figure: the scene, then each body with its forces.
    Raises:
      ValueError: see `analysis.free_body`; there are too many bodies for a picture, `t` is outside
        the motion, or `path` cannot be written.
    Example:
      >>> from jaxdyn import drawing, scenes
      >>> figure = drawing.free_body(scenes.double_pendulum())
      >>> len(figure.axes)
      3
    """
    path = picture_path(path)
    check_kind("of", of, (Scene, Trajectory, HybridTrajectory))
    scene, t, y = (of, t, of.y0 if y is None else y) if isinstance(of, Scene) else _at(of, t, y)
    found = cut_free(scene, t, y)
    if len(found.bodies) > _MOST_BODIES:
        raise _checks.fail("scene", f"at most {_MOST_BODIES} bodies", len(found.bodies))
    view = _VIEW if len(found.bodies[0].centre) == 3 else np.eye(2)
    whole = scene.sketch(jnp.asarray(t, float), jnp.asarray(y))
    shapes = _shapes(whole, view)
    panels = len(found.bodies) + 1
    columns = panels if panels <= 4 else -(-panels // 2)
    rows = -(-panels // columns)
    texts = [_account(body, found) for body in found.bodies]
    below = _LINE * (1 + max(map(len, texts)))
    width = columns * _PANEL
    star = any(f.source == BALANCE for body in found.bodies for f in body.forces)
    note = "* found from the balance of forces and moments of all bodies" if star else ""
    above = heading(title, [scene], width, _verdict(found), note)
    top = _TITLE_LINE * (2.6 + above.count("\n"))
    height = rows * (_PANEL + below) + top
    figure = blank(width, height)
    figure.set_layout_engine("none")
    figure.text(0.5, 1 - 0.5 * _LINE / height, above, fontsize=10, ha="center", va="top")
    axes = []
    for i in range(panels):
        row, column = divmod(i, columns)
        bottom = height - top - row * (_PANEL + below) - _PANEL
        place = column * _PANEL / width, bottom / height, _PANEL / width, _PANEL / height
        axes.append(figure.add_axes(place))
    colours = _colours(found)
    _together(axes[0], shapes, found, _flat(_places(scene, t, y, found), view), view)
    for ax, body, lines in zip(axes[1:], found.bodies, texts, strict=True):
        own = _shapes(body.outline, view)
        if not own and panels == 2 and body.rigid:
            own = [(kind, line) for kind, line in shapes if kind in ("line", "area", "solid")]
        _alone(ax, body, own, found, colours, view, motion)
        below = {"fontsize": 8, "color": INK, "ha": "center", "va": "top"}
        caption = ax.text(0.5, -0.01, "\n".join(lines), transform=ax.transAxes, **below)
        wider = caption.get_window_extent().width / ax.get_window_extent().width
        caption.set_fontsize(8 / max(1.0, wider))
    return finish(figure, path)


def _colours(found: FreeBodies) -> dict[str, str]:
    """A colour for each name of a force."""
    names = dict.fromkeys(f.name for body in found.bodies for f in body.forces)
    return {name: PALETTE[i % len(PALETTE)] for i, name in enumerate(names)}


def _at(motion: Trajectory | HybridTrajectory, t, y) -> tuple[Scene, Any, Any]:
    """The scene of a motion at a time, with its time and state."""
    if y is not None:
        raise _checks.fail("y", "none with a motion", "one", "A motion has its states.")
    pieces = pieces_of(motion)
    t = float(_checks.array("t", t, ()))
    for piece in pieces:
        low, high = sorted((float(piece.ts[0]), float(piece.ts[-1])))
        if low <= t <= high:
            ts = np.asarray(piece.ts)
            i = int(np.abs(ts - t).argmin())
            if ts[i] == t:
                return piece.scene, t, piece.ys[i]
            near = piece.scene.starting(piece.ys[i])
            return piece.scene, t, simulate(near, t, t0=ts[i], samples=2, rtol=1e-12).ys[-1]
    times = (float(ts) for ts in (pieces[0].ts[0], pieces[-1].ts[-1]))
    ends = " to ".join(brief(x, _text.second(pieces[0].scene.labels())) for x in times)
    raise _checks.fail("t", f"a time of the motion, from {ends}", t)


def _verdict(found: FreeBodies) -> str:
    second = found.units[-1]
    rigid = any(body.rigid for body in found.bodies)
    moments = " and their moments about its mass centre to dL/dt" if rigid else ""
    return (
        f"t = {brief(found.t, second)}: on every body the forces add up to m a{moments}, "
        f"to {found.residual:.1e} of the largest"
    )


def _flat(x: Any, view: np.ndarray) -> np.ndarray:
    """Positions or vectors (..., d) in the plane of the picture; those on a line are along x."""
    x = np.asarray(x, float)
    if x.shape[-1] == 1:
        return np.concatenate([x, np.zeros_like(x)], axis=-1)
    return x @ view.T


def _shapes(shapes: tuple[Shape, ...], view: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """The kind and the corners (k, 2) of every line of the shapes."""
    return [
        (shape.kind, line)
        for shape in shapes
        for line in _flat(shape.at, view).reshape(-1, shape.at.shape[-2], 2)
        if shape.kind not in NAMED
    ]


def _draw_shapes(ax, shapes: list[tuple[str, np.ndarray]], width: float) -> None:
    """Draw lines, areas, springs of this half width, pins and the ground."""
    of = {kind: [line for k, line in shapes if k == kind] for kind, _ in shapes}
    get = lambda kind: of.get(kind, [])  # noqa: E731
    springs = [coil(ends, width) for ends in get("spring")]
    springs += [stroke for ends in get("dashpot") for stroke in dashpot(ends, width)]
    add = ax.add_collection
    add(LineCollection(get("ground"), colors=GROUND, linewidths=1.6, zorder=0.6))
    for kind, fill, order in (("area", BODY, 1.4), ("solid", INK, 1.6)):
        add(
            PolyCollection(get(kind), facecolors=fill, edgecolors=INK, linewidths=1.2, zorder=order)
        )
    add(LineCollection(get("line"), colors=INK, linewidths=1.8, zorder=1.5))
    add(LineCollection(springs, colors=INK, linewidths=0.9, zorder=1.5))
    if get("pin"):
        pins = np.concatenate(get("pin"))
        others = [line for k, line in shapes if k != "pin"]
        above = not others or pins[:, 1].mean() >= np.concatenate(others)[:, 1].mean()
        marker = Path(HUNG * (1.0 if above else -1.0))
        ax.plot(*pins.T, ls="", marker=marker, ms=15, c=INK, mfc="white", zorder=1.3)


def _places(scene: Scene, t, y, found: FreeBodies) -> np.ndarray:
    """(b, d) where the mass centres are drawn in the scene; see `System.places`."""
    t, y = jnp.asarray(t, float), jnp.asarray(y)
    shift = np.asarray(scene.system.places(t, y) - scene.points(t, y).r)
    parts = scene.system.bodies(t, y)
    return np.stack(
        [
            body.centre + shift[list(part.points)].sum(axis=0) / max(len(part.points), 1)
            for body, part in zip(found.bodies, parts, strict=True)
        ]
    )


def _together(ax, shapes: list, found: FreeBodies, centres: np.ndarray, view: np.ndarray) -> None:
    """Draw the scene as it is, with the names of the bodies at their mass centres (b, 2)."""
    corners = np.concatenate([centres, *(line for _, line in shapes)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    half = max(float((high - low).max()) / 2, 1e-9 + 0.1 * float(np.abs(corners).max())) * 1.25
    middle = (low + high) / 2
    ax.set(xlim=middle[0] + half * np.array([-1, 1]), ylim=middle[1] + half * np.array([-1, 1]))
    ax.set_aspect("equal")
    _draw_shapes(ax, shapes, 0.05 * half)
    dots = [c for c, body in zip(centres, found.bodies, strict=True) if not body.rigid]
    if dots:
        ax.plot(*np.transpose(dots), "o", color=INK, ms=6, zorder=2)
    ax.set_title("the scene", fontsize=10)
    ax.set(xticks=[], yticks=[])
    ax.spines[:].set_visible(False)
    length = _round_length(half / 2)
    corner = middle + half * np.array([-0.95, -0.98])
    if len(view[0]) == 3:
        _axes(ax, corner + half * np.array([0.3, 0.1]), 0.22 * half, view)
    else:
        ax.plot(corner[0] + np.array([0, length]), [corner[1]] * 2, color=INK, lw=1.2)
        unit = found.units[1]
        ax.text(
            corner[0] + length / 2,
            corner[1] + 0.03 * half,
            brief(length, unit),
            ha="center",
            va="bottom",
            fontsize=8,
            color=INK,
        )
    labels = _Labels(ax)
    strokes = [coil(x, 0.05 * half) if kind == "spring" else x for kind, x in shapes]
    labels.keep_off(strokes)
    for centre, body in zip(centres, found.bodies, strict=True):
        labels.put(centre, np.array([0.6, 0.8]), body.name, INK)


def _round_length(x: float) -> float:
    """The largest of 1, 2 and 5 times powers of ten that is not above a number."""
    power = 10.0 ** np.floor(np.log10(x))
    return float(max(k for k in (1, 2, 5) if k * power <= x * (1 + 1e-9)) * power)


def _axes(ax, corner: np.ndarray, length: float, view: np.ndarray) -> None:
    """Draw the directions of x, y and z in a corner."""
    for name, axis in zip("xyz", view.T, strict=True):
        _arrow(ax, corner, corner + length * axis, INK, width=0.9)
        ax.text(
            *(corner + 1.3 * length * axis), name, fontsize=8, color=INK, ha="center", va="center"
        )


def _alone(
    ax,
    body: FreeBody,
    shapes: list,
    found: FreeBodies,
    colours: dict,
    view: np.ndarray,
    motion: bool,
) -> None:
    """Draw one body with its arrows."""
    ax.set(xlim=(-_EDGE, _EDGE), ylim=(-_EDGE, _EDGE))
    ax.set_aspect("equal")
    ax.axis("off")
    centre = _flat(body.centre, view)
    reach = [line - centre for _, line in shapes]
    reach += [_flat(f.at, view)[None] - centre for f in body.forces]
    size = max(
        float(np.linalg.norm(np.concatenate([np.zeros((1, 2)), *reach]), axis=1).max()), 1e-300
    )
    scale = _BODY_SIZE / size if body.rigid or shapes else 0.0

    def place(x: Any) -> np.ndarray:
        return scale * (_flat(x, view) - centre)

    shown = [(kind, scale * (line - centre)) for kind, line in shapes]
    _draw_shapes(ax, shown, 0.05)
    if body.rigid or shapes:
        ax.plot(0, 0, "o", color=INK, mfc="white", ms=5, zorder=3)
    else:
        ax.plot(0, 0, "o", color=INK, ms=9, zorder=3)
    title = f"{body.name}, m = {brief(body.m, found.units[0])}"
    labels = _Labels(ax, above=ax.set_title(title, fontsize=10, y=0.98))
    labels.keep_off([line for _, line in shown])
    wanted = []
    moment = found.units[3]
    drawn: list[np.ndarray] = []
    arcs: list[np.ndarray] = []
    for f in body.forces:
        colour, at = colours[f.name], place(f.at)
        if not _is_couple(f, found):
            end, direction = _draw_force(ax, at, _flat(f.force, view), found.largest, colour, drawn)
            wanted.append((end, direction, _name_of(f, found), colour))
        if np.any(f.couple):
            named = brief(_magnitude(f.couple), moment, 4)
            named = f"{f.name}\n{named}" if _is_couple(f, found) else named
            arcs.append(_arc(ax, at, f.couple, colour, 0.22 + 0.07 * len(arcs)))
            wanted.append((arcs[-1][20], np.array([0.7, 0.7]), named, colour))
    labels.keep_off([*drawn, *arcs])
    if motion:
        wanted += _draw_motion(ax, body, found, view, labels)
    for label in wanted:
        labels.put(*label)


def _draw_force(
    ax, at: np.ndarray, vector: np.ndarray, largest: float, colour: str, drawn: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Draw one arrow beside those drawn already; return where its label belongs, and the direction.

    The arrow of a force that pushes on a body ends at its point of attack, any other begins there.
    """
    arrow = _LONGEST * vector / (largest or 1.0)
    size = float(np.linalg.norm(arrow))
    if size < _SHORTEST:
        ax.plot(*at, ".", color=colour, ms=5, zorder=5)
        return at, np.array([0.7, -0.7])
    pushes = np.dot(at, arrow) < -0.3 * np.linalg.norm(at) * size
    tail = at - arrow if pushes else at
    ends = np.stack([tail, tail + arrow])
    ends = ends + _beside(ends, drawn)
    drawn.append(ends)
    _arrow(ax, ends[0], ends[1], colour)
    return (ends[0], -arrow / size) if pushes else (ends[1], arrow / size)


def _is_couple(f: Force, found: FreeBodies) -> bool:
    """Whether a force is a pure couple."""
    return bool(np.any(f.couple)) and _magnitude(f.force) <= 1e-12 * found.largest


def _name_of(f: Force, found: FreeBodies) -> str:
    star = "*" if f.source == BALANCE else ""
    size = _magnitude(f.force)
    size = 0.0 if size <= 1e-12 * found.largest else size
    return f"{f.name}{star}\n{brief(size, found.units[2], 4)}"


def _magnitude(x: np.ndarray) -> float:
    return float(np.linalg.norm(x))


def _beside(arrow: np.ndarray, others: list[np.ndarray]) -> np.ndarray:
    """(2,) how far an arrow (2, 2) is moved sideways so as not to lie on another one."""
    along = arrow[1] - arrow[0]
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    for k in range(len(others) + 1):
        shift = 0.08 * ((k + 1) // 2) * (-1) ** k * across
        samples = arrow[0] + shift + np.linspace(0.1, 0.9, 20)[:, None] * along
        if not any((_distance(samples, other) < 0.05).mean() > 0.3 for other in others):
            return shift
    return np.zeros(2)


def _distance(points: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """(p,) distances of points (p, 2) from a segment (2, 2)."""
    along = segment[1] - segment[0]
    share = np.clip((points - segment[0]) @ along / (along @ along), 0.0, 1.0)
    return np.linalg.norm(points - segment[0] - share[:, None] * along, axis=1)


def _draw_motion(
    ax, body: FreeBody, found: FreeBodies, view: np.ndarray, labels: "_Labels"
) -> list:
    """Draw velocity and acceleration of the mass centre beside the body, each to its own scale."""
    wanted = []
    corner = labels.emptiest(np.array([[x, y] for x in (-1.0, 1.0) for y in (-1.0, 1.0)]))
    rounding = 1e-12 * found.largest / body.m if body.m else np.inf
    spin = _magnitude(body.angular_momentum) / (body.m * _reach(body) or np.inf)
    for colour, which, least in (
        (_MOTION[0], "velocity", 1e-12 * spin),
        (_MOTION[1], "acceleration", rounding),
    ):
        longest = max(_magnitude(getattr(b, which)) for b in found.bodies)
        x = getattr(body, which)
        if _magnitude(x) <= max(least, 1e-12 * longest):
            continue
        tip = corner + 0.45 * _flat(x, view) / longest
        _arrow(ax, corner, tip, colour, width=1.4)
        labels.keep_off([np.stack([corner, tip])])
        direction = (tip - corner) / max(_magnitude(tip - corner), 1e-300)
        _, m, *_, second = found.units
        unit = f"{m}/{second}{'' if which == 'velocity' else '^2'}" if m else ""
        wanted.append((tip, direction, f"{which[0]} = {brief(_magnitude(x), unit, 4)}", colour))
    return wanted


def _reach(body: FreeBody) -> float:
    """The largest distance of a point of attack from the mass centre [m]."""
    return max((_magnitude(f.at - body.centre) for f in body.forces), default=0.0)


def _account(body: FreeBody, found: FreeBodies) -> list[str]:
    """The forces on a body and their sums, as lines of text."""
    _, _, newton, moment, _ = found.units
    tiny = 1e-12 * max(found.largest, body.inertial[0], 1e-300)

    def row(x, unit, least):
        x = np.where(np.abs(x) < least, 0.0, x)
        return brief(x.reshape(()) if x.size == 1 else x, unit, 4)

    lines = []
    for f in body.forces:
        turning = row(f.couple, moment, 0.0)
        if _is_couple(f, found):
            lines.append(f"{f.name}: {turning}")
            continue
        lines.append(f"{f.name}: {row(f.force, newton, tiny)}")
        if np.any(f.couple):
            lines.append(f"its moment: {turning}")
    lines = lines or ["no forces"]
    lines.append(f"sum of forces = m a = {row(body.m * body.acceleration, newton, tiny)}")
    if body.rigid:
        least = 1e-12 * max(body.inertial[1], found.largest * _reach(body))
        lines.append(f"sum of moments = dL/dt = {row(body.angular_rate, moment, least)}")
    return lines


def _arrow(ax, tail, tip, colour, *, width: float = 2.0) -> None:
    # A head longer than its arrow would point backwards.
    ends = ax.transData.transform([tail, tip])
    share = min(1.0, _magnitude(ends[1] - ends[0]) * 72 / ax.figure.dpi / _WHOLE_HEAD)
    look = {"arrowstyle": "-|>,head_width=0.22,head_length=0.45", "lw": share * width}
    look |= {"shrinkA": 0, "shrinkB": 0, "color": colour, "mutation_scale": 10 * share}
    ax.annotate("", tip, tail, arrowprops=look, zorder=4)


def _arc(ax, at: np.ndarray, couple: np.ndarray, colour: str, radius: float) -> np.ndarray:
    """Draw an arc (40, 2) around a point in the sense of a moment, seen along its axis."""
    sense = float(couple) if couple.ndim == 0 else float(couple[np.abs(couple).argmax()])
    angle = np.radians(
        np.linspace(200.0, -20.0, 40) if sense < 0 else np.linspace(-20.0, 200.0, 40)
    )
    curve = at + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ax.plot(*curve[:-4].T, color=colour, lw=1.6, zorder=4)
    _arrow(ax, curve[-6], curve[-1], colour, width=1.6)
    return curve


class _Labels:
    """Labels on axes that do not overlap each other, arrows or the edge."""

    def __init__(self, ax, above=None):
        self.ax, self.taken, self.lines = ax, [], []
        if above is not None:
            self.taken.append(self._box(above))

    def _box(self, text) -> Bbox:
        box = text.get_window_extent()
        corners = self.ax.transData.inverted().transform([[box.x0, box.y0], [box.x1, box.y1]])
        return Bbox(corners)

    def keep_off(self, lines: list[np.ndarray]) -> None:
        """Add lines (k, 2) that no label should cover."""
        for line in lines:
            for a, b in itertools.pairwise(line):
                self.lines.append(a + np.linspace(0, 1, 100)[:, None] * (b - a))
            self.lines += [line] if len(line) == 1 else []

    def emptiest(self, places: np.ndarray) -> np.ndarray:
        """The position, of several (p, 2), that is farthest from all lines."""
        points = np.concatenate([np.zeros((1, 2)), *self.lines])
        apart = np.linalg.norm(places[:, None] - points[None], axis=-1).min(axis=1)
        return places[int(apart.argmax())]

    def put(self, at: np.ndarray, direction: np.ndarray, text: str, colour) -> None:
        """Put a text near a point, preferably in this direction from it."""
        ax = self.ax
        drawn = ax.text(
            *at,
            text,
            color=colour,
            fontsize=8,
            ha="center",
            va="center",
            zorder=6,
            linespacing=1.05,
        )
        box = self._box(drawn)
        half = np.array([box.width, box.height]) / 2
        (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
        unit = (x1 - x0) / (2 * _EDGE)
        points = np.concatenate([np.zeros((0, 2)), *self.lines])
        start = np.arctan2(direction[1], direction[0])
        tried = []
        for far, k in itertools.product(_FAR, range(_ALL_ROUND)):
            turn = (k + 1) // 2 * (-1) ** k * 2 * np.pi / _ALL_ROUND
            aim = np.array([np.cos(start + turn), np.sin(start + turn)])
            middle = at + aim * (far * unit + np.abs(aim) @ half)
            room = half + np.array([0.03 * unit, 0.0])
            mine = Bbox([middle - room, middle + room])
            over = sum(_overlap(mine, other) for other in self.taken) / (4 * half.prod())
            inside = (np.abs(points - middle) < half * 1.06).all(axis=1).sum()
            out = max(0.0, *(middle + half - [x1, y1]), *([x0, y0] - (middle - half))) / unit
            # First clear of other labels and the edge, then of lines, then near and straight ahead.
            cost = 40 * over + 60 * out + 0.6 * inside + 0.5 * abs(turn) + 3 * far
            tried.append((cost, tuple(middle), mine))
        _, middle, mine = min(tried, key=lambda found: found[0])
        drawn.set_position(middle)
        self.taken.append(mine)


def _overlap(a: Bbox, b: Bbox) -> float:
    both = Bbox.intersection(a, b)
    return 0.0 if both is None else both.width * both.height
