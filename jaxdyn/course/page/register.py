"""The register of the course, read from the file of each page without running it.

Since it is derived from the files, it cannot differ from them: the title is the first line of the
docstring, the answer is the paragraph that begins with "Answer: ", the solution is the text after
it, and the names are those that the code uses.
"""

import ast
import functools
from pathlib import Path
from typing import Any, NamedTuple

_FOLDER = Path(__file__).parents[1]
_ANSWER = "Answer: "

#: Topics in the order in which they are shown.
TOPICS = (
    "vectors and rotations",
    "one particle",
    "many particles",
    "pendulums and linkages",
    "constraints",
    "rolling and skating",
    "rigid bodies in space",
)


class Problem(NamedTuple):
    """A problem of the course, and its page.

    Attributes:
      number: number of the problem in the course.
      name: name of the page, as in ``python -m jaxdyn.course.circling_bodies``.
      topic: one of `TOPICS`.
      title: a few words.
      statement: the problem.
      answer: the answer in a few sentences.
      solution: the answer of each part, with formulas, in paragraphs and indented blocks; empty if
        the answer is complete.
      code: the text of its file.
    """

    number: int
    name: str
    topic: str
    title: str
    statement: str
    answer: str
    solution: str
    code: str

    @property
    def names(self) -> tuple[str, ...]:
        """The public names that the page uses, such as ``jaxdyn.simulate``."""
        return _names(ast.parse(self.code))

    def as_dict(self) -> dict[str, Any]:
        """All of it, for a JSON object."""
        return self._asdict() | {"names": self.names}

    @property
    def asks_for_equations(self) -> bool:
        """Whether the equations of motion are part of the answer."""
        return "equation" in self.statement


@functools.cache
def problems() -> dict[int, Problem]:
    """The problems of the course that have a page, by number."""
    found = [_read(path) for path in _FOLDER.glob("[a-z]*.py")]
    assert len({problem.number for problem in found}) == len(found), (
        "two pages with the same number"
    )
    return {problem.number: problem for problem in sorted(found)}


def _read(path: Path) -> Problem:
    """The problem in the file of a page."""
    text = path.read_text()
    tree = ast.parse(text)
    title, _, rest = (ast.get_docstring(tree) or "").partition("\n")
    statement, _, answered = rest.partition(_ANSWER)
    answer, _, solution = answered.partition("\n\n")
    data = {
        target.id: ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name) and target.id in ("PROBLEM", "TOPIC")
    }
    return Problem(
        number=data["PROBLEM"],
        name=path.stem,
        topic=data["TOPIC"],
        title=title.removesuffix("."),
        statement=statement.strip(),
        answer=" ".join(answer.split()),
        solution=solution.rstrip(),
        code=text,
    )


def _names(tree: ast.Module) -> tuple[str, ...]:
    """The dotted names below `jaxdyn` and `orbits` that a file uses, each once, in order."""
    roots = {}
    for node in tree.body:
        if isinstance(node, ast.Import):
            roots |= {alias.asname or alias.name: alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            roots |= {a.asname or a.name: f"{node.module}.{a.name}" for a in node.names}
    inner = {node.value for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    used = [node for node in ast.walk(tree) if isinstance(node, ast.Attribute | ast.Name)]
    dotted = [ast.unparse(node) for node in used if node not in inner]
    found = {}
    for name in dotted:
        root, dot, rest = name.partition(".")
        whole = roots.get(root, "") + dot + rest
        ours = whole.startswith(("jaxdyn.", "orbits.")) and not whole.startswith("jaxdyn.course.")
        if ours and all(part.isidentifier() for part in whole.split(".")):
            found[whole] = None
    return tuple(found)
