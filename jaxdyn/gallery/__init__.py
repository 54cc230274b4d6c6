"""The static site: course, pictures of what the library does, tutorials, guides, reference.

``solve(page)`` in the file of a problem in `jaxdyn/course` decides what its page shows, and
`templates/problem.md` in which order.

`site` builds the site from records: `problems` runs the pages of the course, `tutorials` the
notebooks, `exhibits` the other pages (accuracy, hard cases, families, and the orbits of `poster`),
`formulas` derives the equations of ready-made scenes for the reference.
Each writes a record and `pictures`, which are made again only if sources changed (`records`). Their
programs compile in half of the time by the settings of `compiling`. From the records and the
guides, `sources` writes the input of Sphinx; `reference` lists the public names for it, and `texts`
has helpers for the templates. `docs/conf.py` configures Sphinx, with `docstrings` as an extension.
The folders `guides`, `entrances` and `tutorials` have the texts, and `templates` has the templates
of pages.

May import: `course`, `player`, `symbolic`; and `orbits`.

To add an exhibit, write a function in `exhibits` that returns a record, and an entry of its
`PARTS`; to add a guide, write a Markdown file in `guides`, and a line in `templates/guides.md`.
"""

import lazy_loader

import jaxdyn._doors

_listed, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

#: Renamed in version 0.3.
_RENAMED = {"Built": "BuiltSite"}
__getattr__ = jaxdyn._doors.attribute_getter(__name__, _listed, renamed=_RENAMED)
