"""Search by a word: scenes, effects, guides, commands, problems of the course, the glossary.

All are searched as text, before JAX is loaded. Terms of the field that the texts do not use are
mapped to those that they do.
"""

import ast
import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import jaxdyn
from jaxdyn.cli.docstrings import SceneText

#: Terms of the field, with the beginnings of the words that the texts use instead.
_SYNONYMS = {
    "constraint": ("tie", "constrained", "rod", "roll"),
    "forcing": ("drive", "driven", "shak", "pulse", "force f cos"),
    "input": ("drive", "driven", "shak", "force f cos", "transfer function"),
    "actuator": ("motor", "drive", "driven", "shak"),
    "damping": ("damp", "drag", "friction"),
    "damper": ("damp", "drag"),
    "elastic": ("spring", "oscillator"),
    "air resistance": ("drag",),
    "matrix": ("matrices", "matrix", "vibration"),
    "finite element": ("matrices", "vibration"),
    "hz": ("vibration",),
    "hertz": ("vibration",),
    "rotor": ("imbalance", "spinning top"),
    "range": ("launch angle",),
    "unbalance": ("imbalance",),
    "rigid": ("box", "plate", "satellite", "spinning top"),
    "rigid body": ("box", "plate", "satellite", "spinning top"),
    "boundary condition": ("closing",),
    "halo": ("restricted", "libration"),
    "attractor": ("basin",),
    "estimation": ("fit",),
    "regression": ("fit",),
    "training": ("neural", "fit"),
    "gradient": ("derivative",),
    "sensitivity": ("derivative",),
    "machine learning": ("neural",),
    "optimisation": ("design",),
    "optimization": ("design",),
    "frf": ("frequency response", "transfer function"),
    "harmonic balance": ("frequency response", "backbone"),
    "mode": ("mode", "vibration", "backbone"),
    "nnm": ("nonlinear normal mode", "backbone"),
    "resonance": ("vibration", "frequency response", "force f cos", "driven"),
    "flutter": ("eigenvalues", "vibration", "hopf"),
    "campbell": ("eigenvalues", "vibration"),
    "root locus": ("eigenvalues",),
    "vibration": ("oscillator", "masses in a row", "spring chain"),
    "target": ("launch angle", "cannonball"),
    "mdof": ("masses in a row", "spring chain"),
    "degree of freedom": ("masses in a row", "spring chain"),
    "suspension": ("masses in a row", "vibration"),
    "quarter car": ("masses in a row", "vibration"),
    "floquet": ("find an orbit",),
    "shooting": ("find an orbit",),
    "limit cycle": ("find an orbit", "hopf"),
    "poincare": ("section",),
    "poincare map": ("section",),
    "strobe": ("stroboscop", "section", "snapshot"),
    "stroboscope": ("stroboscop", "section", "snapshot"),
    "stroboscopic": ("stroboscop", "section"),
    "kapitza": ("shaken", "shaking base"),
    "strange attractor": ("chao", "lorenz", "basin"),
    "butterfly": ("lorenz",),
    "tipping point": ("basin",),
    "bifurcation": ("bifurcation", "fold", "hopf"),
    "gyroscope": ("spinning top", "turns freely about", "precession"),
    "kepler": ("two body", "power law", "central force", "circle about"),
    "planet": ("planet", "n body", "two body", "central force"),
    "slingshot": ("n body", "massless body", "libration"),
    "gravity assist": ("n body", "massless body", "libration"),
    "spacecraft": ("massless body", "libration"),
    "elastic pendulum": ("spring mass",),
    "spring pendulum": ("spring mass",),
    "projectile": ("cannonball", "thrown"),
    "robot": ("walk", "four bar", "cart"),
    "walking robot": ("walk",),
    "gait": ("walk",),
    "impact": ("impact", "bounce"),
    "collision": ("impact", "bounce", "encounter"),
    "bouncing": ("bounce",),
    "coriolis": ("rotating frame", "gyroscopic", "defined by a force"),
    "foucault": ("gyroscopic", "defined by a force"),
    "foucault pendulum": ("gyroscopic", "defined by a force"),
    "shock": ("pulse",),
    "earthquake": ("steps, pulses", "masses in a row"),
    "solar": ("n body", "horizons"),
    "solar system": ("n body", "horizons"),
    "transfer": ("from one orbit",),
    "transfer orbit": ("from one orbit", "libration point"),
    "mathieu": ("shaken", "shaking base", "curves in two parameters"),
    "mathieu equation": ("shaken", "shaking base", "curves in two parameters"),
    "quasiperiodic": ("invariant tori", "frequency response"),
    "neimark-sacker": ("invariant tori", "bifurcation"),
    "tongue": ("curves in two parameters", "special orbits in two parameters"),
    "arnold tongue": ("curves in two parameters", "special orbits in two parameters"),
}

_EFFECTS = Path(__file__).parents[1] / "effects"
_GUIDES = Path(__file__).parents[1] / "gallery" / "guides"
_COMMAND = re.compile(r'^def (\w+)_command\((.*?)\n    """([^"\n]+)', re.MULTILINE | re.DOTALL)
_FEW = 3  # an option that more commands share does not tell what they are about
_LINES = 3  # a guide is about a word if it has the word in this many lines
_CHANGES = "20_changes.md"  # it contains every word, and is about none


def about(word: str, zoo: Mapping[str, SceneText]) -> list[str]:
    """The names of the scenes whose texts contain a word."""
    return [name for name, scene in zoo.items() if _is_in(word, _text(name, scene))]


def guides(word: str, times: int = _LINES) -> dict[str, str]:
    """The titles of the guides that are about a word, by their files in `jaxdyn/gallery/guides`.

    Args:
      word: the word.
      times: number of lines with the word from which on a guide is about it, if no heading has it.
    """
    found = {}
    for path in sorted(_GUIDES.glob("*.md")):
        lines = path.read_text(encoding="utf-8").splitlines()
        headings = " ".join(line for line in lines if line.startswith("#"))
        if path.name == _CHANGES:
            continue
        if _is_in(word, headings) or sum(_is_in(word, line, ()) for line in lines) >= times:
            found[path.name] = lines[0].removeprefix("# ")
    return found


def effects(word: str) -> dict[str, str]:
    """What effects do whose name or docstring contains a word."""
    named = ((f"jaxdyn.effects.{name}", text) for name, text in _effects())
    found = ((name, text) for name, text in named if _is_in(word, f"{name}: {text}"))
    return {name: text.partition("\n")[0].rstrip(".") for name, text in found}


@cache
def _effects() -> tuple[tuple[str, str], ...]:
    """The effects with their docstrings, from the text of the files in which they are."""
    trees = (ast.parse(path.read_text(encoding="utf-8")) for path in sorted(_EFFECTS.glob("*.py")))
    classes = (x for tree in trees for x in tree.body if isinstance(x, ast.ClassDef))
    return tuple((x.name, ast.get_docstring(x) or "") for x in classes if x.name[0] != "_")


def commands(word: str) -> dict[str, str]:
    """What commands do whose name or description contains a word, or, of a few, an option."""
    found = {name: does for name, _, does in _commands() if _is_in(word, f"{name}: {does}")}
    by_option = {name: does for name, options, does in _commands() if _is_in(word, options, ())}
    return found | (by_option if len(by_option) <= _FEW else {})


@cache
def _commands() -> tuple[tuple[str, str, str], ...]:
    """The commands, their options and what they do, from the text of the files with them."""
    root = Path(__file__).parents[2]
    return tuple(
        (
            f"{package} {name.replace('_', '-')}",
            " ".join(re.findall(r"^    (\w+):", options, re.MULTILINE)),
            does.rstrip("."),
        )
        for package in ("jaxdyn", "orbits")
        for path in sorted((root / package / "cli").rglob("*.py"))
        for name, options, does in _COMMAND.findall(path.read_text(encoding="utf-8"))
    )


def problems(word: str) -> dict[int, str]:
    """The titles of the problems of the course that contain a word."""
    listed = jaxdyn.course.problems()
    return {n: problem.title for n, problem in listed.items() if _is_in(word, problem.title)}


def meanings(word: str) -> dict[str, str]:
    """The entries of the glossary that contain a word, in the term or in its meaning."""
    return {ours: meaning for ours, meaning in _words() if _is_in(word, f"{ours}: {meaning}", ())}


@cache
def _words() -> tuple[tuple[str, str], ...]:
    """The terms with their meanings, from the tables of the guide to conventions."""
    (guide,) = _GUIDES.glob("*_conventions.md")
    rows = re.findall(r"^\| ([^|`]+) \| ([^|]+) \|$", guide.read_text(encoding="utf-8"), re.M)
    return tuple(rows)


def _is_in(word: str, text: str, same: tuple[str, ...] | None = None) -> bool:
    """Whether words of a text begin with the singular of a word, or with a synonym."""
    word, text = _plain(word), _plain(text)
    one = word.removesuffix("s") if len(word) > 3 else word
    same = _SYNONYMS.get(word, _SYNONYMS.get(one, ())) if same is None else same
    return any(re.search(rf"\b{re.escape(begins)}", text) for begins in (one, *same))


def _plain(text: str) -> str:
    """A text in lower case, with spaces between the words of a name such as QuadraticDrag."""
    return re.sub(r"[_-]|(?<=[a-z])(?=[A-Z])", " ", text).casefold()


def _text(name: str, scene: SceneText) -> str:
    meanings = (p.meaning for p in scene.parameters.values())
    return " ".join([name, scene.summary, *scene.parameters, *meanings])
