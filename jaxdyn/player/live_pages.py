"""Pages on which a scene runs, integrated in the browser, with adjustable parameters."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from jaxdyn import _checks, _text
from jaxdyn._checks import check_first
from jaxdyn.files.output_files import page_path, replace
from jaxdyn.player.choices import Ask, Choices, complete
from jaxdyn.player.model import model
from jaxdyn.player.pages import PlayerPage, look, page, script
from jaxdyn.scene import Scene

_MOST_BYTES = 200_000  # limit for a page
_MOST_MOTIONS = 20
#: The scripts that a page needs besides `canvas`, in order.
SCRIPTS = ("dop853", "motion", "live")


@check_first
def live(
    scene: Scene | Mapping[str, Scene],
    path=None,
    *,
    title: str = "",
    motions: int = 1,
    choose: str = "",
    asks: Sequence[Ask] = (),
) -> PlayerPage:
    """A page on which a scene runs, as a single file that needs no other files and no network.

    Parameters and initial state have sliders and fields, bodies can be dragged to set the initial
    state, and effects have checkboxes. Several motions can start close to each other, energies and
    entries of the state are plotted against time or each other, and a section is drawn. A change of
    a parameter or an effect in the middle of the motion holds from then on.

    The page evaluates the formulas of this library in JavaScript, and integrates them with the pair
    of order 8 of Dormand and Prince at a tolerance of 1e-13. Conditions of the rate are evaluated
    at each stage, so that steps are cut where they change. Ready-made scenes with impacts and
    changes of contact run through their phases (`scenes.phases_of`), whose exits can be switched
    off.

    Args:
      scene: a scene; or several of one kind by name, which differ in parameters and initial states,
        and may lack effects.
      path: a file to write the page to, .html.
      title: its heading; the name of the scene by default.
      motions: number of motions at first, 1 to 20; their initial states differ by a thousandth.
      choose: a parameter with its unit, whose values are the names of the scenes: a slider then
        selects one. By default they run side by side.
      asks: questions beside it, with their answers folded.
    Returns:
      The page; a notebook shows it as the last value of a cell.
    Raises:
      ValueError: `motions` is out of range, the scenes are not of one kind, the rate has no
        formulas (a loop of unknown length, a callback, linear algebra, a search in a table other
        than that of `jnp.interp`), the page is longer than 200 kB, or `path` cannot
        be written. `simulate(scene).play(path)` shows a computed motion.
    Example:
      >>> from jaxdyn import player, scenes
      >>> player.live(scenes.pendulum())  # doctest: +ELLIPSIS
      PlayerPage(... kB of HTML): a notebook shows it
    """
    _checks.check_on_host("scene", scene)
    path = None if path is None else page_path(path)
    scenes = scene if isinstance(scene, Mapping) else {"": scene}
    return write_page(Choices(scenes, choose), path, title=title, motions=motions, asks=asks)


def write_page(
    choices: Choices, path: Path | None, *, title: str, motions: int, asks: Sequence[Ask] = ()
) -> PlayerPage:
    """The page for a choice of scenes, also written as a file."""
    shown = fragment(choices, motions=motions, asks=asks)
    name = title or _text.title_of(complete(choices)).replace("_", " ").capitalize()
    text = page(name, look("player", "live"), shown, script(*SCRIPTS))
    size = len(text.encode())
    if size > _MOST_BYTES:
        remedy = "Play a computed motion instead: jaxdyn.simulate(scene).play(path)."
        expected = f"a page of at most {_MOST_BYTES // 1000} kB"
        raise _checks.fail("live", expected, f"{size // 1000} kB of formulas", remedy)
    if path is not None:
        replace(path, text)
    return PlayerPage(text)


def fragment(choices: Choices, *, motions: int = 1, asks: Sequence[Ask] = ()) -> str:
    """The part of a page on which scenes run; the page must contain `canvas` and `SCRIPTS`."""
    _text.whole("motions", motions, most=_MOST_MOTIONS)
    text = model(complete(choices), motions, choices, asks)
    return (
        '<div class="live"></div>\n<script>(window.liveScenes ??= [])'
        f".push([document.currentScript.previousElementSibling, {text}]);</script>"
    )
