"""An extension of Sphinx that reads our docstrings and links the names in texts.

Docstrings are plain text with sections in Google's style and code in backticks; here they are
converted to reStructuredText for napoleon. Code that names a public object becomes a link to its
page, wherever it occurs. Formulas become MathML, which browsers render without a script.
"""

import html
import itertools
import re
import textwrap

from docutils import nodes
from docutils.utils.math import MathError, latex2mathml
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util import logging

from jaxdyn.gallery.reference import Target, targets

_LOGGER = logging.getLogger(__name__)
#: Sections of docstrings; those that napoleon has no field for become headings or lists.
SECTIONS = (
    "Args",
    "Attributes",
    "Returns",
    "Raises",
    "Limits",
    "Example",
    "Reference",
    "References",
)
CUSTOM = [("Attributes", "params_style"), "Returns", "Limits", "Reference", "References"]
_HEAD = re.compile(rf"^({'|'.join(SECTIONS)}):[ ]*(.*)$", re.MULTILINE)
_CODE = re.compile(r"(``.+?``|`[^`]+`)", re.DOTALL)
_SPECIAL = re.compile(r"([\\*|`]|(?<=\w)_(?!\w))")
_EXAMPLE = re.compile(r"^ *>>> .*(?:\n.*\S.*)*", re.MULTILINE)  # up to an empty line
_NAME = re.compile(r"([A-Za-z]\w*(?:\.\w+)*)(\(.*\))?", re.DOTALL)
_LINKED = nodes.title, nodes.reference, addnodes.pending_xref
_BEFORE, _AFTER = re.compile(r"[\w)\]]$"), re.compile(r"^[\w(\[=]")


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the parts of the extension."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", _docstring, priority=400)  # before napoleon
    app.connect("doctree-read", _link)
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def as_rest(text: str) -> str:
    """A docstring as reStructuredText in Google's style, as napoleon reads it."""
    text = text.partition("\n\nMay import:")[0]  # the rest is for contributors
    pieces = _HEAD.split(text)
    found = [_prose(pieces[0])]
    for name, first, rest in zip(pieces[1::3], pieces[2::3], pieces[3::3], strict=True):
        # Paragraphs with less indentation do not belong to the section.
        inside, *after = re.split(r"\n\n(?=\S)", rest.strip("\n"), maxsplit=1)
        body = "\n".join(filter(None, (first, textwrap.dedent(inside))))
        found += [f"{name}:\n{textwrap.indent(_prose(body), '    ')}", *map(_prose, after)]
    return "\n\n".join(part.strip("\n") for part in found)


def _prose(text: str) -> str:
    """Paragraphs in which examples and indented blocks are kept and the rest is escaped."""
    blocks = re.split(r"\n[ ]*\n", _EXAMPLE.sub(r"\n\g<0>", text).strip("\n"))
    found, shown = [], False
    for block in blocks:
        example, indented = block.lstrip().startswith(">>> "), block.startswith("  ")
        if indented and not example:
            # As in Markdown, an indented block is shown literally.
            found += [block] if shown else ["::", block]
        else:
            found.append(block if example else _escape(block))
        shown = indented and not example
    return "\n\n".join(found)


def _escape(block: str) -> str:
    """A paragraph with its code as literals and all other special characters escaped."""
    pieces = _CODE.split(block)
    for i, piece in enumerate(pieces):
        if i % 2 == 0:
            pieces[i] = _SPECIAL.sub(r"\\\1", piece)
            continue
        code = " ".join(piece.strip("`").split())
        before = r"\ " if _BEFORE.search(pieces[i - 1]) else ""
        after = r"\ " if _AFTER.search(pieces[i + 1]) else ""
        pieces[i] = f"{before}``{code}``{after}"
    return "".join(pieces)


def _docstring(_app, _what, _name, _thing, _options, lines: list[str]) -> None:
    lines[:] = [*as_rest("\n".join(lines)).splitlines(), ""]


def _link(_app: Sphinx, tree: nodes.document) -> None:
    """Link code that names a public object to its page."""
    for code in list(tree.findall(nodes.literal)):
        found = _NAME.fullmatch(code.astext())
        if found is None or isinstance(code.parent, _LINKED):
            continue
        target = targets().get(found[1]) or _nearby(found[1], code)
        if target is None:
            continue
        link = addnodes.pending_xref(
            "",
            refdomain="py",
            reftype="mod" if target.module else "obj",
            reftarget=target.name,
            refexplicit=True,
            refwarn=True,
            refdoc=tree.settings.env.docname,
        )
        code.replace_self(link)
        link += code


def _nearby(name: str, code: nodes.literal) -> Target | None:
    """The target of a name in a docstring, looked up in its class, module and package."""
    place = code.parent
    while place is not None and not isinstance(place, addnodes.desc):
        place = place.parent
    if place is None:
        return None
    signature = next(iter(place.findall(addnodes.desc_signature)))
    own = ".".join(filter(None, (signature["module"], signature["fullname"])))
    if name in {part.astext() for part in signature.findall(addnodes.desc_sig_name)}:
        return None  # an argument
    scopes = itertools.accumulate(own.split("."), "{}.{}".format)
    found = (targets().get(f"{scope}.{name}") for scope in reversed([*scopes]))
    return next((x for x in found if x and not x.module and x.name != own), None)


def _inline(self, node: nodes.math) -> None:
    self.body.append(_mathml(node))
    raise nodes.SkipNode


def _block(self, node: nodes.math_block) -> None:
    self.body.append(f'<div class="formulas">{_mathml(node, as_block=True)}</div>')
    raise nodes.SkipNode


def _mathml(node: nodes.Element, **how: bool) -> str:
    """A formula as MathML; one that cannot be parsed is shown as source, with a warning."""
    try:
        return latex2mathml.tex2mathml(node.astext(), **how)
    except MathError as error:
        _LOGGER.warning("%s in the formula %s", error, node.astext(), location=node)
        return f"<code>{html.escape(node.astext())}</code>"
