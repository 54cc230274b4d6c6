"""Lines of print under titles, as plain text, in LaTeX and in MathML."""

import html
import re
from collections.abc import Iterable
from typing import NamedTuple

from jaxdyn import _checks
from jaxdyn.symbolic.algebra import ONE, Call, Expression, Symbol, as_expression, factors_in
from jaxdyn.symbolic.typesetting import LATEX, MATHML, TEXT, Style


class Line(NamedTuple):
    """A line of print: left = right."""

    left: Expression
    right: Expression


class Note(NamedTuple):
    """The meaning of a symbol or a function, in words."""

    symbol: Expression
    meaning: str


class Section(NamedTuple):
    """Lines that belong together.

    Attributes:
      name: the name by which it is selected, such as "motion".
      title: the title.
      lines: the lines.
      notes: explanations below them.
      remarks: what follows each line, such as a unit; () for none.
    """

    name: str
    title: str
    lines: tuple[Line, ...] = ()
    notes: tuple[Note, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def remarked(self) -> list[tuple[Line, str]]:
        """Each line with its remark."""
        remarks = self.remarks or ("",) * len(self.lines)
        return list(zip(self.lines, remarks, strict=True))


class Printed:
    """Sections in print.

    Attributes:
      sections: everything in print.
    """

    sections: tuple[Section, ...]

    def __init__(self, sections: Iterable[Section]):
        self.sections = tuple(sections)

    def text(self, part: str | None = None) -> str:
        """Everything as plain text, or one part: the name of a section, such as "motion"."""
        return "\n".join(
            "\n  ".join([part.title, *_lines(part), *map(_note, part.notes)])
            for part in self._chosen(part)
        )

    def latex(self, part: str | None = None) -> str:
        """Everything in LaTeX, for the inside of a displayed formula, or one part."""
        blocks = []
        for section in self._chosen(part):
            rows = [
                f"{LATEX.expression(line.left)} &= {LATEX.expression(line.right)}{_latex(remark)}"
                for line, remark in section.remarked
            ]
            rows += [
                f"{LATEX.expression(note.symbol)} &: \\text{{{note.meaning}}}"
                for note in section.notes
            ]
            body = " \\\\\n".join(rows) or f"\\text{{{section.title}}}"
            blocks.append(f"\\begin{{aligned}}\n{body}\n\\end{{aligned}}")
        if len(blocks) == 1:
            return blocks[0]
        together = "\n\\\\[1ex]\n".join(blocks)
        return f"\\begin{{gathered}}\n{together}\n\\end{{gathered}}"

    def mathml(self, part: str | None = None) -> str:
        """Everything as HTML with MathML, or one part: a paragraph and formulas each."""
        return "\n".join(
            "\n".join(
                [
                    f"<p>{html.escape(section.title, quote=False)}</p>",
                    *(
                        f'<math display="block">{x}{_mathml(remark)}</math>'
                        for x, remark in _equations(section, MATHML)
                    ),
                    *(
                        f"<p><math>{MATHML.expression(note.symbol)}</math>: "
                        f"{html.escape(note.meaning, quote=False)}</p>"
                        for note in section.notes
                    ),
                ]
            )
            for section in self._chosen(part)
        )

    def _chosen(self, part: str | None) -> tuple[Section, ...]:
        if part is None:
            return self.sections
        _checks.choice("part", part, [section.name for section in self.sections])
        return tuple(section for section in self.sections if section.name == part)

    def _repr_markdown_(self) -> str:
        return "\n\n".join(f"{x.title}\n\n$$\n{self.latex(x.name)}\n$$" for x in self.sections)

    def __repr__(self) -> str:
        return self.text()


#: Functions whose names not every reader knows.
_FUNCTIONS = {
    "sign": "the sign of u: 1, -1, or 0 where u = 0",
    "step": "the unit step: 0 where u < 0, and 1 from u = 0 on",
}


def functions_in(lines: Iterable[Line]) -> list[Note]:
    """Notes on the functions in some lines that not every reader knows."""
    factors = (a for line in lines for x in line for a, _ in factors_in(x))
    used = {a.op for a in factors if isinstance(a, Call)}
    argument = as_expression(Symbol("u", "short"))
    return [
        Note(Expression({((Call(op, argument), ONE),): ONE}), meaning)
        for op, meaning in _FUNCTIONS.items()
        if op in used
    ]


def _note(note: Note) -> str:
    return f"{TEXT.expression(note.symbol)}: {note.meaning}"


def _equations(section: Section, style: Style) -> list[tuple[str, str]]:
    return [
        (style.relation(style.expression(line.left), "=", style.expression(line.right)), remark)
        for line, remark in section.remarked
    ]


def _lines(section: Section) -> list[str]:
    return [f"{x} {remark}".rstrip() for x, remark in _equations(section, TEXT)]


def _latex(remark: str) -> str:
    """A remark as text, in which powers are formulas."""
    if not remark:
        return ""
    powers = re.sub(r"\^(-?\w+)", r"$^{\1}$", remark)
    return rf"\ \text{{{powers}}}"


def _mathml(remark: str) -> str:
    return f"<mtext>\N{NO-BREAK SPACE}{html.escape(remark, quote=False)}</mtext>" if remark else ""
