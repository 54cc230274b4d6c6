"""A part of the site is built; every page is complete, linked, and opens in a real browser."""

import html.parser
import json
import time
from pathlib import Path

import browser as chromium
import numpy as np
import pytest
from helpers import refusal

from jaxdyn import gallery, hard
from jaxdyn.gallery import exhibits, poster, records, reference, texts, writing

#: Cheap problems, in the plane and in space, with sliders, several motions, none.
CHOSEN = (7, 16, 22, 54)
MOST_BYTES = 2_000_000  # of a page


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


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site with four problems, built in processes as a user would."""
    found = gallery.build(tmp_path_factory.mktemp("site"), only=CHOSEN, workers=2)
    assert not found.failed
    assert not found.untrue
    return found


@pytest.fixture(scope="module")
def pages(site):
    return {page: Parsed(site.folder / page) for page in site.pages}


def test_every_link_leads_somewhere(site, pages):
    for page, parsed in pages.items():
        here = (site.folder / page).parent
        for link in parsed.links:
            path, _, place = link.partition("#")
            if link.startswith("data:") or "://" in link:
                continue
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
            assert picture["alt"] or page == "index.html", page
            assert {"width", "height"} <= set(picture), page
        size = (site.folder / page).stat().st_size
        assert size < MOST_BYTES, page


@pytest.mark.parametrize("width", [390, 1280])
def test_every_page_opens_without_a_message_and_fits(site, width):
    window = chromium.start()
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    window.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        for page in site.pages:
            chromium.opened(window, site.folder / page)
            wide = window.execute_script("return document.documentElement.scrollWidth")
            assert wide <= width, page
            broken = window.execute_script(
                "return [...document.images].filter(i => i.loading !== 'lazy' && !i.naturalWidth)"
                ".map(i => i.src)"
            )
            assert broken == [], page
    finally:
        window.quit()


@pytest.mark.slow
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_text_stands_out_and_headings_leave_no_level_out(site, theme):
    window = chromium.start()
    media = {"features": [{"name": "prefers-color-scheme", "value": theme}]}
    window.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
    levels = "return [...document.querySelectorAll('h1, h2, h3, h4, h5')].map(h => +h.tagName[1])"
    try:
        for page in site.pages:
            chromium.opened(window, site.folder / page)
            assert chromium.faint(window) == [], page
            found = window.execute_script(levels)
            assert found[0] == 1, page
            assert max(np.diff(found), default=0) <= 1, page
    finally:
        window.quit()


def test_the_players_of_the_pages_play_to_the_end_of_their_motions(site):
    window = chromium.start()
    try:
        for page in (page for page in site.pages if page.startswith("course/")):
            record = json.loads((site.folder / ".records" / f"{Path(page).stem}.json").read_text())
            chromium.opened(window, site.folder / page)
            for nth in range(len(record["played"])):
                chromium.player(window, "pause()", nth)
                chromium.player(window, "seek(-1e9)", nth)
                before = chromium.picture(window, nth)
                chromium.player(window, "seek(1e9)", nth)
                assert chromium.picture(window, nth) != before, page
                state = chromium.player(window, "state()", nth)
                assert np.isfinite(state["points"]).all()
    finally:
        window.quit()


def test_only_pages_whose_sources_changed_run_again(site, monkeypatch):
    def never(*_):
        raise AssertionError

    path = site.folder / ".records" / "circling_bodies.json"
    before = path.stat().st_mtime_ns
    again = gallery.build(site.folder, only=[16], workers=1)
    assert again.pages == site.pages
    assert path.stat().st_mtime_ns == before
    monkeypatch.setattr(records, "digest", lambda source: "another")
    with pytest.raises(AssertionError):
        records.keep(site.folder, "circling_bodies", path, never)


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
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "a.png").write_text("")
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
            "gallery/writing.py",
            "cli/run.py",
        )
    }
    assert [path for path, counted in counts.items() if not counted] == [
        "course/koenig.py",
        "gallery/writing.py",
        "cli/run.py",
    ]


def test_the_first_sentence_ends_at_a_full_stop_and_not_within_a_formula():
    first = writing._first
    assert first("With n it is |n . (c - a)| / |n|.\nB is e.g. 2. More.") == (
        "With n it is |n . (c - a)| / |n|"
    )
    assert first("One sentence.") == "One sentence"
    assert first("word " * 40).endswith("word ...")
    assert len(first("word " * 40)) <= 114


def test_an_exhibit_shows_what_its_record_has(tmp_path):
    drawing = {"file": "a.png", "look": "A line.", "width": 8, "height": 6}
    record = {"title": "Lines", "text": "Straight `jaxdyn.simulate`."}
    minis = [{"name": "loop", "lines": ("T = 1",), "path": {"x": [[0]], "y": [[0]], "reach": 1}}]
    tables = [{"title": "", "head": ["digits"], "rows": [["3"], ["6"]]}]
    figures = [{"what": "error", "value": "1e-9", "bound": "at most 1e-8"}]
    case = {"name": "a", "what": "It holds.", "seconds": "0.1", "figures": figures}
    cases = [{"topic": "Drift", "cases": [case | {"holds": held} for held in (True, False)]}]
    site = writing.Site(tmp_path, ["plain", "full"])
    site.exhibit("plain", record)
    site.exhibit("full", record | {"drawings": [drawing], "tables": tables, "minis": minis})
    site.exhibit("hard", record | {"cases": cases})
    site.exhibit("poster", record | {"drawings": [drawing | {"other": "a.pdf"}]})
    plain, full, other = (Parsed(tmp_path / f"{name}.html") for name in ("plain", "full", "poster"))
    assert (plain.headings, plain.pictures) == (["h1"], [])
    assert len(full.pictures) == 1
    assert "minis.js" in full.links
    hard_page = (tmp_path / "hard.html").read_text()
    assert "1 of 2 cases hold" in hard_page
    assert [hard_page.count(word) for word in ("holds</span>", "fails</span>", "1e-8")] == [1, 1, 2]
    assert "pictures/a.pdf" in set(other.links) - set(full.links)


@pytest.mark.sample("no-preference")
@pytest.mark.parametrize("motion", ["no-preference", "reduce"])
def test_miniatures_move_until_they_are_stopped(tmp_path, motion):
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    path = {"x": [np.cos(turn).tolist()], "y": [np.sin(turn).tolist()], "reach": 1.0}
    site = writing.Site(tmp_path, ["loops"])
    site.assets()
    minis = [{"name": "loop", "lines": (), "path": path}]
    site.exhibit("loops", {"title": "Loops", "text": "One.", "minis": minis})
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
    chapters = reference.chapters()
    names = [entry.name for chapter in chapters.values() for entry in chapter.entries]
    assert len(set(names)) == len(names) > 600
    assert {"jaxdyn.simulate", "jaxdyn.effects.Spring", "orbits.find"} <= set(names)
    for chapter in chapters.values():
        for entry in chapter.entries:
            assert entry.kind == "value" or entry.summary, entry.name
    assert (
        reference.urls()["jaxdyn.scenes.pendulum"]
        == "reference/jaxdyn.scenes.html#jaxdyn.scenes.pendulum"
    )


def test_docstrings_become_lists_and_coloured_examples():
    found = reference.docstring_html(
        "A thing.\n\nArgs:\n  x: a length [m],\n    or two.\nExample:\n  >>> 1\n  1"
    )
    assert "<li><strong><code>" in found
    assert '<pre class="code">' in found
    inline = texts.prose("Like this:\n\n>>> 1 + 1\n2\n\nand so on.")
    assert '<pre class="code">' in inline
    assert "blockquote" not in inline
    linked = texts.link("<code>orbits.find</code>", reference.urls(), "../")
    assert linked == '<a href="../reference/orbits.html#orbits.find"><code>orbits.find</code></a>'


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
    assert "<h2>The equations</h2>" in page
    assert page.count('<math display="block">') == 3  # of motion, T and V
