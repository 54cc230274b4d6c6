"""The table of claims: its quotations are in the texts, its names exist, nothing is left out."""

import ast
import functools
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LEDGER = (ROOT / "tests" / "CLAIMS.md").read_text()
#: The README and the texts of the site, by their names.
TEXTS = {"README": ROOT / "README.md"} | {
    path.name: path
    for folder in ("guides", "entrances", "tutorials")
    for path in sorted((ROOT / "jaxdyn" / "gallery" / folder).glob("*.md"))
}
SECTIONS = dict(
    re.findall(r"^## (README|\d\d_\w+\.md)\n(.*?)(?=^## )", LEDGER, re.MULTILINE | re.DOTALL)
)
#: Statements with these words can be wrong; the guide of changes says what was.
WORDS = re.compile(r"\bnever\b|\bto rounding\b|\bexactly\b|\bto 1e-1\d")
#: Those that promise nothing of the library: advice, and definitions.
NO_CLAIMS = {
    "04_effects.md": ["a value that is never 0"],
}


def text_of(section: str) -> str:
    return squeezed(re.sub(r"```.*?```", "", TEXTS[section].read_text(), flags=re.DOTALL))


def squeezed(text: str) -> str:
    return re.sub(r"\s+", " ", text)


def rows(section: str) -> list[tuple[str, list[str]]]:
    """The quotations of a section, each with what keeps it."""
    lines = [line for line in SECTIONS[section].splitlines() if line.startswith("| ")][1:]
    cells = [line.strip("| ").split(" | ") for line in lines]
    assert all(len(row) == 2 for row in cells)
    return [(quoted, re.findall(r"`([^`]+)`", kept)) for quoted, kept in cells]


@functools.cache
def functions(file: str) -> set[str]:
    tree = ast.parse((ROOT / file).read_text())
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


@pytest.mark.parametrize("section", SECTIONS)
def test_what_is_quoted_is_said_and_what_keeps_it_exists(section):
    found, text = rows(section), text_of(section)
    assert found
    for quoted, keepers in found:
        assert quoted in text, "this is no longer said"
        assert keepers, quoted
        for keeper in keepers:
            file, _, name = keeper.partition("::")
            assert name.startswith("test_") or file.startswith("benchmarks/"), keeper
            assert not name or name in functions(file), keeper
            assert (ROOT / file).exists(), keeper


@pytest.mark.parametrize("section", TEXTS)
def test_no_statement_with_such_a_word_is_left_out(section):
    text = text_of(section)
    if section == "20_changes.md":
        return
    listed = [quoted for quoted, _ in rows(section)] if section in SECTIONS else []
    spans = [
        (text.index(quoted), text.index(quoted) + len(quoted))
        for quoted in [*listed, *NO_CLAIMS.get(section, ())]
    ]
    left = [
        text[max(0, word.start() - 40) : word.end() + 40]
        for word in WORDS.finditer(text)
        if not any(start <= word.start() and word.end() <= end for start, end in spans)
    ]
    assert not left


def test_there_is_one_list_of_known_gaps():
    assert LEDGER.count("## Known gaps") == 1
    assert LEDGER.partition("## Known gaps")[2].count("\n- ") >= 3
