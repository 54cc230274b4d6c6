"""What a notebook shows of scenes, motions and results: the rows of `repr`, and a small picture."""

import ast
import base64
import html
import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.figure import Figure

import jaxdyn
from jaxdyn import Scene, _text, scenes, simulate, solve
from jaxdyn.drawing import figures, space
from jaxdyn.drawing.figures import MOST_BYTES, Picture
from jaxdyn.integrate.phase import HybridTrajectory
from jaxdyn.status import Status

ROOT = Path(__file__).parents[2]
#: One line each, which `repr` shows as well.
PARTS = {"System", "Effect", "Symbol", "Call", "Group", "Expression", "Resonance", "Method"}


def rows(text: str) -> list[tuple[str, str]]:
    """The rows of an HTML table."""
    found = re.findall(r"<tr><th[^>]*>([^<]*)</th><td[^>]*>([^<]*)</td></tr>", text)
    return [(html.unescape(name), html.unescape(said)) for name, said in found]


def picture(text: str) -> bytes:
    """The one picture of a text, which is small and has another text for it."""
    ((about, data),) = re.findall(r'<img alt="([^"]+)" src="data:image/png;base64,([^"]*)">', text)
    found = base64.b64decode(data, validate=True)
    assert about.startswith("Picture of ")
    assert found.startswith(b"\x89PNG")
    assert 1000 < len(found) <= MOST_BYTES
    return found


def assert_same_as_printed(x, text: str):
    head, *lines = repr(x).split("\n")
    assert f"<strong>{html.escape(head)}</strong>" in text
    printed = " ".join(" ".join(lines).split())
    assert " ".join(f"{name} {said}" for name, said in rows(text)) == printed


def throw(speed=20.0):
    return simulate(scenes.cannonball(speed=speed), 1.0, samples=5)


def chain():
    piece = throw()
    return HybridTrajectory(
        names=("fly", "fly"),
        pieces=(piece, piece),
        t=piece.ts[-1],
        y=piece.ys[-1],
        ended=True,
        status=Status.OK,
        path=(("fly", 0), ("fly", 0)),
    )


def states(t, y):
    return [y[1], -y[0], y[3], -y[2]]


@pytest.mark.sample("throw", "chain", "scene", "in space")
@pytest.mark.parametrize(
    "make",
    [
        throw,
        chain,
        scenes.cannonball,
        scenes.lorenz,
        lambda: simulate(jaxdyn.ode(states, [1.0, 0.0, 0.0, 1.0], 3.0), samples=5),
        lambda: simulate(scenes.cannonball(speed=1e200, drag=1.0), samples=3, throw=False),
    ],
    ids=["throw", "chain", "scene", "in space", "no points", "failed"],
)
def test_a_notebook_shows_what_is_printed_and_a_picture(make):
    x = make()
    text = x._repr_html_()
    assert_same_as_printed(x, text)
    picture(text)


def test_a_scene_is_drawn_where_it_starts():
    figure = space.pose(scenes.pendulum(angle=0.5))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["start"]
    dots = [line.get_xydata() for line in figure.axes[0].lines if len(line.get_xdata()) == 1]
    assert any(np.allclose(dot, [[np.sin(0.5), -np.cos(0.5)]]) for dot in dots)


@pytest.mark.slow
def test_of_a_batch_the_first_motions_are_drawn(monkeypatch):
    drawn = []
    monkeypatch.setattr(
        "jaxdyn.drawing.space.trajectory",
        lambda motions, **look: drawn.append((motions, look)) or figures.blank(2, 2),
    )
    batch = jax.vmap(throw)(jnp.arange(1.0, 10.0))
    text = batch._repr_html_()
    assert_same_as_printed(batch, text)
    ((motions, look),) = drawn
    assert look == {"title": "", "names": ["0", "1", "2", "3", "4", "5", "6"]}
    assert np.array_equal(motions[6].ys, batch.one(6).ys)


def test_results_are_tables():
    for x in (solve(scenes.oscillator(), 1.0), jaxdyn.linearize(scenes.oscillator(), jnp.zeros(2))):
        text = x._repr_html_()
        assert_same_as_printed(x, text)
        assert "<img" not in text


def test_text_is_escaped():
    evil = "<script>alert('&\"')</script>"
    shown = Scene(scenes.cannonball().system, (), y0=np.ones(4), name=evil)._repr_html_()
    assert "<script" not in shown
    assert html.escape(evil) in shown
    assert "&lt;b&gt;" in _text.html(_Made(_text.table("<b>", [("<i>", "<u>")])))
    assert _text.html(_Made("<b> & none")) == "<pre>&lt;b&gt; &amp; none</pre>"


class _Made:
    """Something with a text."""

    def __init__(self, text):
        self.text = text

    def __repr__(self):
        return self.text


def test_what_cannot_be_drawn_is_shown_all_the_same(monkeypatch):
    motion = throw()

    def broken(*args, **options):
        raise RuntimeError("no picture today")

    monkeypatch.setattr("jaxdyn.drawing.space.trajectory", broken)
    text = motion._repr_html_()
    assert_same_as_printed(motion, text)
    assert "<img" not in text


def test_in_any_condition_there_is_a_text():
    texts = []

    @jax.jit
    def inside(scene):
        texts.append(scene._repr_html_())
        return scene.y0

    inside(scenes.pendulum())
    gone = scenes.pendulum()
    gone.y0.delete()
    several = jax.vmap(lambda r: scenes.pendulum(length=r))(jnp.ones(3))
    broken = Scene(None, (), y0=np.ones(2))  # pyright: ignore[reportArgumentType]
    for text in (*texts, *(x._repr_html_() for x in (gone, several, broken))):
        assert text.startswith(("<table", "<pre>"))


def test_a_picture_is_small_or_refused():
    figure = figures.blank(10, 10)
    figure.figimage(np.random.default_rng(0).uniform(size=(800, 800, 3)))
    assert isinstance(figure, Picture)
    with pytest.raises(ValueError, match=rf"picture: expected one of at most {MOST_BYTES} bytes"):
        figure.small()
    assert isinstance(figures.blank(1, 1, kind=Figure), Figure)


def _classes():
    for package in ("jaxdyn", "orbits"):
        for file in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.ClassDef):
                    yield node


def test_every_class_that_is_printed_as_a_table_is_one_in_notebooks():
    found = 0
    for node in _classes():
        named = {x.name for x in node.body if isinstance(x, ast.FunctionDef)}
        targets = [t for x in node.body if isinstance(x, ast.Assign) for t in x.targets]
        named |= {name.id for t in targets for name in ast.walk(t) if isinstance(name, ast.Name)}
        if "__repr__" in named and node.name not in PARTS and not node.name.startswith("_"):
            bases = {base.id for base in node.bases if isinstance(base, ast.Name)}
            shown = named & {"_repr_html_", "_repr_markdown_"}
            assert shown or bases & {"Motion", "Matrices", "Printed"}, node.name
            found += 1
    assert found >= 40
