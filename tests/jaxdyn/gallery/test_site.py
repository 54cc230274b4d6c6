"""A part of the site is built; every page is complete, linked, found, and opens in a browser.

The default run builds it with the page of one problem, the slow one with several.
"""

import contextlib
import html.parser
import json
import time
import warnings
from pathlib import Path

import browser as chromium
import numpy as np
import pytest
from helpers import refusal

pytest.importorskip("sphinx", reason="Sphinx is not installed: the site was not built")

from docutils import nodes
from sphinx.search.en import SearchEnglish
from sphinx.util.inventory import InventoryFile

from jaxdyn import gallery, hard, scenes
from jaxdyn.course import simple_pendulum
from jaxdyn.gallery import (
    docstrings,
    exhibits,
    formulas,
    poster,
    records,
    reference,
    sources,
    texts,
    tutorials,
)
from jaxdyn.player.model import model
from jaxdyn.player.pages import script
from jaxdyn.scenes import catalogue

#: A cheap problem.
ONE = (22,)
#: In the plane and in space, with sliders, several motions, none.
SEVERAL = (7, 16, 22, 54, "tutorials/first_motion")
MOST_BYTES = 2_000_000  # limit for a page


class Parsed(html.parser.HTMLParser):
    """The links, pictures, ids and headings of a page."""

    def __init__(self, path: Path):
        super().__init__()
        self.links, self.pictures, self.ids, self.headings = [], [], set(), []
        self.feed(path.read_text())

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        if "id" in found:
            self.ids.add(found["id"])
        if tag in ("a", "link") and found.get("href"):
            self.links.append(found["href"])
        if tag in ("img", "script") and found.get("src"):
            self.links.append(found["src"])
        if tag == "img":
            self.pictures.append(found)
        if tag in ("h1", "h2", "h3", "h4"):
            self.headings.append(tag)


@contextlib.contextmanager
def _others_may_deprecate():
    """Sphinx and its extensions call each other by names that they will give up."""
    with warnings.catch_warnings():
        for kind in (DeprecationWarning, PendingDeprecationWarning):
            warnings.simplefilter("ignore", kind)
        yield


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(ONE, id="one page"),
        pytest.param(SEVERAL, id="several", marks=pytest.mark.slow),
    ],
)
def site(request, tmp_path_factory):
    """The site with these problems and tutorials, built in processes as a user would."""
    with _others_may_deprecate():
        found = gallery.build(tmp_path_factory.mktemp("site"), only=request.param, workers=2)
    assert not found.failed
    assert not found.untrue
    return found


@pytest.fixture(scope="module")
def pages(site):
    return {page: Parsed(site.folder / page) for page in site.pages}


def test_every_reference_in_the_texts_resolves(site):
    assert site.warnings == ()


def test_every_link_leads_somewhere(site, pages):
    for page, parsed in pages.items():
        here = (site.folder / page).parent
        for link in parsed.links:
            path, _, place = link.partition("#")
            if link.startswith(("data:", "mailto:")) or "://" in link:
                continue
            path = path.partition("?")[0]
            target = (here / path).resolve() if path else (site.folder / page).resolve()
            known = str(target.relative_to(site.folder.resolve()))
            assert target.exists(), (page, link)
            if place and known in pages:
                assert place in pages[known].ids, (page, link)


def test_every_page_has_one_title_and_pictures_with_a_text(site, pages):
    for page, parsed in pages.items():
        assert parsed.headings.count("h1") == 1, page
        for picture in parsed.pictures:
            assert "alt" in picture, page
            assert picture["alt"] or page == "course/index.html", page
        size = (site.folder / page).stat().st_size
        assert size < MOST_BYTES, page


def test_every_public_name_is_in_the_inventory_of_the_site(site):
    names = {name for name, _ in reference._public()}
    inventory = InventoryFile.loads((site.folder / "objects.inv").read_bytes(), uri="")
    found = {name for kind in inventory.data for name in inventory.data[kind]}
    assert names <= found
    assert {"jaxdyn.Scene.starting", "jaxdyn.analysis.energy"} <= found


def test_names_in_texts_lead_to_the_reference(site):
    guide = (site.folder / "guides/orbits.html").read_text()
    assert 'href="../reference/orbits.html#orbits.find" title="orbits.find"><code' in guide
    # In docstrings without the package's name as well, except where an argument has that name.
    page = (site.folder / "reference/jaxdyn.html").read_text()
    link = 'href="#jaxdyn.simulate" title="jaxdyn.simulate"><code'
    assert sum(">simulate<" in rest.partition("</a>")[0] for rest in page.split(link)) > 5


#: Words that people search for, and a page that answers.
SOUGHT = {
    "figure eight": "guides/orbits",
    "stiff": "guides/solvers",
    "Floquet": "entrances/vibrations",
    "drag": "guides/getting_started",
    "frequency response": "guides/vibrations",
    "halo": "reference/jaxdyn.scenes",
}


@pytest.mark.parametrize("words", SOUGHT)
def test_the_search_of_the_site_finds(site, words):
    text = (site.folder / "searchindex.js").read_text()
    index = json.loads(text.removeprefix("Search.setIndex(").removesuffix(")"))
    stem = SearchEnglish({}).stem
    found = set(range(len(index["docnames"])))
    for word in words.split():
        there = [index[terms].get(stem(word.lower()), []) for terms in ("terms", "titleterms")]
        found &= {doc for of in there for doc in ([of] if isinstance(of, int) else of)}
    assert SOUGHT[words] in {index["docnames"][doc] for doc in found}


def _shown(site):
    """All pages but those of the reference, of which there are a few."""
    listed = [page for page in site.pages if page.startswith("reference/")]
    return [page for page in site.pages if page not in listed] + listed[::20]


@pytest.mark.sample("one page-390")
@pytest.mark.parametrize("width", [390, 1280])
def test_every_page_opens_without_a_message_and_fits(site, width):
    window = chromium.start()
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    window.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        for page in _shown(site):
            chromium.opened(window, site.folder / page, ignored="INFO")  # the theme says hello
            wide = window.execute_script("return document.documentElement.scrollWidth")
            assert wide <= width, page
            assert chromium.foreign(window) == [], page
            broken = window.execute_script(
                "return [...document.images].filter(i => i.loading !== 'lazy' && !i.naturalWidth)"
                ".map(i => i.src)"
            )
            assert broken == [], page
    finally:
        window.quit()


def test_the_search_of_the_site_works_from_a_disk(site):
    window = chromium.start()
    try:
        window.get(f"{(site.folder / 'search.html').as_uri()}?q=figure+eight")
        chromium.wait(window, "document.querySelectorAll('#search-results li').length > 3")
        assert [one for one in window.get_log("browser") if one["level"] != "INFO"] == []
        assert chromium.foreign(window) == []
    finally:
        window.quit()


def test_scenes_follow_the_theme_of_the_page(site):
    window = chromium.start()
    picture = "document.querySelector('.stage').toDataURL()"
    colour = "getComputedStyle(document.querySelector('.live')).getPropertyValue('--paper')"
    try:
        chromium.opened(window, site.folder / "course/simple_pendulum.html", ignored="INFO")
        seen = []
        for theme in ("light", "dark"):
            window.execute_script(f"document.documentElement.dataset.theme = '{theme}'")
            seen.append(window.execute_script(f"return [{colour}, {picture}]"))
        assert [colours for colours, _ in seen] == ["rgb(255, 255, 255)", "rgb(22, 25, 30)"]
        chromium.wait(window, f"{picture} !== '{seen[0][1]}'")
    finally:
        window.quit()


@pytest.mark.slow
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_text_stands_out_and_headings_leave_no_level_out(site, theme):
    window = chromium.start()
    media = {"features": [{"name": "prefers-color-scheme", "value": theme}]}
    window.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
    headings = "document.querySelectorAll('article :is(h1, h2, h3, h4, h5)')"
    levels = f"return [...{headings}].map(h => +h.tagName[1])"
    try:
        for page in set(_shown(site)) - {"genindex.html", "py-modindex.html", "search.html"}:
            chromium.opened(window, site.folder / page, ignored="INFO")
            assert chromium.faint(window, "main") == [], page
            found = window.execute_script(levels)
            assert found[0] == 1, page
            assert max(np.diff(found), default=0) <= 1, page
    finally:
        window.quit()


def test_scenes_run_and_motions_are_played_on_the_pages_of_the_course(site):
    window = chromium.start()
    try:
        for page in set(site.pages) - {"course/index.html"}:
            if not page.startswith("course/"):
                continue
            record = json.loads((site.folder / ".records" / f"{Path(page).stem}.json").read_text())
            chromium.opened(window, site.folder / page, ignored="INFO")
            lives = "return document.querySelectorAll('.live').length"
            runs = [one["runs"] for one in record["played"]]
            assert window.execute_script(lives) == sum(runs)
            for nth in range(sum(runs)):
                ends = f"const l = document.querySelectorAll('.live')[{nth}].live; "
                state = window.execute_script(ends + "l.seek(l.span); return l.state()")
                assert np.isfinite(state["now"]).all(), page
                assert state["failure"] == "", page
            for nth in range(len(runs) - sum(runs)):
                chromium.player(window, "pause()", nth)
                chromium.player(window, "seek(-1e9)", nth)
                before = chromium.picture(window, nth)
                chromium.player(window, "seek(1e9)", nth)
                assert chromium.picture(window, nth) != before, page
                state = chromium.player(window, "state()", nth)
                assert np.isfinite(state["points"]).all()
    finally:
        window.quit()


@pytest.mark.slow
def test_a_site_is_built_again_without_running_its_pages(site):
    path = site.folder / ".records" / "simple_pendulum.json"
    before = path.stat().st_mtime_ns
    with _others_may_deprecate():
        again = gallery.build(site.folder, only=[22], workers=1)
    assert again.pages == site.pages
    assert path.stat().st_mtime_ns == before


def test_only_pages_whose_sources_changed_run_again(site, monkeypatch):
    def never():
        raise AssertionError

    def again():
        source = Path(simple_pendulum.__file__)
        records.keep(site.folder, "simple_pendulum", source, never)

    again()
    monkeypatch.setattr(records, "digest", lambda source: "another")
    with pytest.raises(AssertionError):
        again()


def test_a_record_is_made_again_where_it_is_damaged_or_lacks_a_picture(tmp_path, monkeypatch):
    monkeypatch.setattr(records, "digest", lambda source: "same")
    made = []

    def make():
        made.append(1)
        return {"drawings": [{"file": "a.png"}]}

    def again():
        records.keep(tmp_path, "a", tmp_path, make)
        return len(made)

    assert again() == 1
    assert again() == 2  # the picture is missing
    records.pictures(tmp_path).mkdir(parents=True)
    (records.pictures(tmp_path) / "a.png").write_text("")
    assert again() == 2
    for text in ("", "[]", "{}", '{"digest": "older"}'):
        (tmp_path / ".records" / "a.json").write_text(text)
        before = len(made)
        assert again() == before + 1
    assert records.stored_record(tmp_path, "b") is None


def test_a_change_of_what_makes_records_changes_their_digest_and_rendering_does_not():
    counts = {
        path: records._counts(Path(path))
        for path in (
            "scene.py",
            "data/plane_orbits.json",
            "gallery/problems.py",
            "course/page/running.py",
            "course/koenig.py",
            "gallery/sources.py",
            "cli/run.py",
        )
    }
    assert [path for path, counted in counts.items() if not counted] == [
        "course/koenig.py",
        "gallery/sources.py",
        "cli/run.py",
    ]


def test_the_first_sentence_ends_at_a_full_stop_and_not_within_a_formula():
    first = texts.first
    assert first("With n it is |n . (c - a)| / |n|.\nB is e.g. 2. More.") == (
        "With n it is |n . (c - a)| / |n|"
    )
    assert first("One sentence.") == "One sentence"
    assert first("\nOne sentence.\n\n| a table |\n") == "One sentence"
    assert first("word " * 40).endswith("word ...")
    assert len(first("word " * 40)) <= 114


LOOP = {"name": "loop", "lines": ("T = 1",)}


def test_an_exhibit_shows_what_its_record_has(tmp_path):
    drawing = {"file": "a.png", "look": "A line.", "width": 8, "height": 6}
    record = {"title": "Lines", "text": "Straight `jaxdyn.simulate`."}
    tables = [{"title": "", "head": ["digits"], "rows": [["3"], ["6"]]}]
    figures = [{"what": "error", "value": "1e-9", "bound": "at most 1e-8"}]
    case = {"name": "a", "what": "It holds.", "seconds": "0.1", "figures": figures}
    cases = [{"topic": "Drift", "cases": [case | {"holds": held} for held in (True, False)]}]
    shown = {
        "plain": record,
        "full": record | {"drawings": [drawing], "tables": tables, "minis": [LOOP], "model": "1"},
        "hard": record | {"cases": cases},
        "poster": record | {"drawings": [drawing | {"other": "a.pdf"}]},
    }
    written = sources.Sources(tmp_path)
    written.exhibits({name: exhibits.join([one]) for name, one in shown.items()})
    plain, full, hard_page, other = ((tmp_path / f"{name}.md").read_text() for name in shown)
    assert "figure" not in plain
    assert full.count("{figure} /pictures/a.png") == 1
    assert "| digits |\n| --- |\n| 3 |" in full
    assert "var minis = 1;" in full
    assert "minis.js" in full
    assert "1 of 2 cases hold" in hard_page
    assert [hard_page.count(word) for word in ("holds</span>", "fails</span>", "1e-8")] == [1, 1, 2]
    assert "{download}`As a PDF file </pictures/a.pdf>`" in other
    assert written.pages == {*shown, "exhibits"}


def test_texts_link_pages_and_for_a_tutorial_that_has_not_run_the_table_of_all(tmp_path):
    written, page = sources.Sources(tmp_path), tmp_path / "entrances" / "periodic_orbits.md"
    written.texts()
    assert "](../guides/orbits.md)" in page.read_text()
    assert "](../tutorials/index.md)" in page.read_text()
    written.tutorials({"tutorials/halo_family": tutorials.notebook("[x](../guides/11_orbits.md)")})
    written.texts()
    assert "](../tutorials/halo_family.ipynb)" in page.read_text()
    notebook = (tmp_path / "tutorials" / "halo_family.ipynb").read_text()
    assert "](../guides/orbits.md)" in notebook


@pytest.mark.sample("no-preference")
@pytest.mark.parametrize("motion", ["no-preference", "reduce"])
def test_miniatures_move_until_they_are_stopped(tmp_path, motion):
    page = (
        '<button data-minis-play></button><canvas data-mini="0" width="220" height="220"></canvas>'
        f"<script>var minis = {model(scenes.two_body())};"
        f"{script('dop853', 'motion')}{(Path(gallery.__file__).parent / 'minis.js').read_text()}"
        "</script>"
    )
    (tmp_path / "loops.html").write_text(page)
    window = chromium.start()
    media = {"features": [{"name": "prefers-reduced-motion", "value": motion}]}
    window.execute_cdp_cmd("Emulation.setEmulatedMedia", media)

    def moves() -> bool:
        canvas = "return document.querySelector('canvas[data-mini]').toDataURL()"
        before = window.execute_script(canvas)
        time.sleep(0.5)
        return window.execute_script(canvas) != before

    try:
        chromium.opened(window, tmp_path / "loops.html")
        # The circle is as large as its canvas allows.
        ink = "return [...document.querySelector('canvas').getContext('2d')"
        rows = window.execute_script(ink + ".getImageData(0, 0, 220, 220).data]")
        drawn = np.argwhere(np.reshape(rows, (220, 220, 4))[:, :, 3])
        assert (np.ptp(drawn, axis=0) > 0.85 * 220).all()
        button = window.find_element("css selector", "[data-minis-play]")
        says = ["Pause all", "Play all"]
        for now in (0, 1, 0) if motion == "no-preference" else (1, 0, 1):
            assert button.text == says[now]
            assert moves() == (now == 0)
            button.click()
    finally:
        window.quit()


def test_names_that_are_no_pages_are_refused(tmp_path):
    assert "jaxdyn list --problems" in refusal(
        lambda: gallery.build(tmp_path, only=["doublependulum"])
    )
    (tmp_path / "file").write_text("")
    message = refusal(lambda: gallery.build(tmp_path / "file" / "site", only=[16]))
    assert "a folder that can be written" in message


def test_the_reference_has_every_public_name_once():
    names = [entry.name for of in reference.chapters().values() for entry in of]
    assert len(set(names)) == len(names) > 600
    assert {"jaxdyn.simulate", "jaxdyn.effects.Spring", "orbits.find"} <= set(names)
    for of in reference.chapters().values():
        for entry in of:
            assert entry.kind == "value" or (entry.thing.__doc__ or "").strip(), entry.name
    assert reference.targets()["jaxdyn.scenes.pendulum"].name == "jaxdyn.scenes.pendulum"
    assert reference.targets()["jaxdyn.analysis.energy"].module


def test_a_scene_shows_what_it_solves():
    page = reference.pages({"jaxdyn.scenes.pendulum": "<p>Lagrange's</p>\n<math></math>"})
    shown = page["jaxdyn.scenes"].partition("autofunction:: jaxdyn.scenes.pendulum\n")[2]
    assert shown.startswith(
        "\n   .. raw:: html\n\n"
        '      <div class="formulas">\n      <p>Lagrange\'s</p>\n      <math></math>\n      </div>'
    )
    assert page["jaxdyn.scenes"].count("raw:: html") == 1


@pytest.mark.slow
def test_every_ready_made_scene_has_its_equations():
    found = formulas.formulas_record()["formulas"]
    documented = {entry.name for entry in reference.chapters()["jaxdyn.scenes"]}
    assert found.keys() <= documented
    assert len(found) > 50
    assert all("<math" in text for text in found.values())


def test_a_class_has_a_page_with_its_methods_by_kind():
    page = reference.pages()["jaxdyn.Scene"]
    assert page.index("rubric:: Properties") < page.index("rubric:: Methods")
    assert ".. automethod:: jaxdyn.Scene.starting" in page
    inherited = reference.pages()["jaxdyn.HybridTrajectory"]
    assert "rubric:: Inherited" in inherited or "Inherited" not in page


def test_docstrings_become_sections_examples_and_escaped_text():
    found = docstrings.as_rest(
        "A `thing` of |v| and x_.\n\nArgs:\n  x: a length [m],\n    or two.\n"
        "Limits: none\n  at all.\nExample:\n  >>> 1\n  1\n\nMay import: nothing."
    )
    assert found == (
        "A ``thing`` of \\|v\\| and x\\_.\n\nArgs:\n    x: a length [m],\n      or two.\n\n"
        "Limits:\n    none\n    at all.\n\nExample:\n    >>> 1\n    1"
    )
    assert docstrings.as_rest("As `q`s:\n>>> 1\n1") == "As ``q``\\ s:\n\n>>> 1\n1"
    assert docstrings.as_rest("Says:\n\n    a = b\n\nHere.") == "Says:\n\n::\n\n    a = b\n\nHere."
    after = docstrings.as_rest("A.\n\nAttributes:\n  x: one.\n\nMore of it.")
    assert after.endswith("x: one.\n\nMore of it.")


def test_formulas_are_mathml_and_one_that_cannot_be_read_is_told(caplog):
    assert "<mfrac>" in docstrings._mathml(nodes.math("", r"\frac{a}{b}"))
    assert docstrings._mathml(nodes.math("", "$<")) == "<code>$&lt;</code>"


def test_the_blocks_of_a_tutorial_are_cells():
    notebook = tutorials.notebook("# One\n\n```python\nx = 1\n```\n\nTwo.\n\n```sh\nls\n```\n")
    kinds = [(cell["cell_type"], cell["source"]) for cell in notebook["cells"]]
    assert kinds == [
        ("markdown", "# One"),
        ("code", "x = 1"),
        ("markdown", "Two.\n\n```sh\nls\n```"),
    ]
    assert next(iter(tutorials.files())) == "tutorials/first_motion"


def test_the_stored_orbits_are_fifty_and_close():
    rows = poster.starts()
    assert len(rows) == 50
    assert sum(bool(row["name"]) for row in rows) == 13
    assert len({round(row["T"], 6) for row in rows}) == 50


def test_a_page_of_parts_shows_all_of_them_and_holds_where_they_do():
    parts = [
        {"title": "A", "text": "a", "tables": [1], "holds": True},
        {"title": "B", "text": "b", "tables": [2], "drawings": [3], "holds": False},
    ]
    page = exhibits.join(parts)
    assert (page["title"], page["text"], page["holds"]) == ("A", "a", False)
    assert (page["tables"], page["drawings"], page["cases"]) == ([1, 2], [3], [])
    assert exhibits.join(parts[:1])["holds"]


def test_every_hard_case_is_in_one_part_of_its_page():
    names = [name for part in exhibits.EXHIBITS["hard"] for name in _cases(part)]
    assert sorted(names) == sorted(hard.CASES)


def _cases(part):
    return exhibits.PARTS[part].make.args[0]


@pytest.mark.slow
def test_the_page_of_a_problem_prints_its_equations(site):
    page = (site.folder / "course/simple_pendulum.html").read_text()
    assert "<h2>The equations<" in page
    # Of motion, the force of the rod, T, V and their sum.
    assert page.count('<math display="block">') == 5


def test_a_build_leaves_functions_as_they_are(site):
    assert site.pages
    beta = catalogue.entry("lorenz").parameters["beta"]
    assert type(beta) is float
