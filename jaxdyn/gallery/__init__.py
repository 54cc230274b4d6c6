"""The static site: course, pictures of what the library does, tutorials, guides, reference.

What the page of a problem shows is decided by ``solve(page)`` in its file in `jaxdyn/course`, and
in which order by `templates/problem.md`.

`site` builds the site from records: `problems` runs the pages of the course, `tutorials` the
notebooks, `exhibits` the other pages (accuracy, hard cases, families, and the orbits of `poster`),
`formulas` derives the equations of ready-made scenes for the reference.
Each leaves a record and `pictures`, made again only where sources changed (`records`), and with
programs that `compiling` has XLA make in half of the time. `sources` writes from them, and from the
guides, what Sphinx reads; `reference` lists the public names there, `texts` has what templates
need. Sphinx makes the site as `docs/conf.py` says, with `docstrings` as its extension. The folders
`guides`, `entrances` and `tutorials` have the texts, `templates` the frames of pages.

May import: `course`, `player`, `symbolic`; and `orbits`.

One more exhibit is a function in `exhibits` that returns a record, and an entry of its `PARTS`;
one more guide is a Markdown file in `guides`, and a line in `templates/guides.md`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
