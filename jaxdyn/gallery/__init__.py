"""The static site: the course as a gallery, pictures of what the library does, guides, reference.

What the page of a problem shows is decided by ``solve(page)`` in its file in `jaxdyn/course`, and
in which order by `templates/problem.html`.

`site` builds the site from records: `problems` runs the pages of the course, `exhibits` the other
pages (accuracy, hard cases, families, and the orbits of `poster`), each of which leaves a record
and `pictures`, made again only where sources changed (`records`), and with programs that
`compiling` has XLA make in half of the time. `reference` reads the docstrings, `texts` renders
Markdown and code, `writing` fills the templates. The folders `guides` and `templates` have the
texts and the frames of pages.

May import: `course`, `player`, `symbolic`; and `orbits`.

One more exhibit is a function in `exhibits` that returns a record, and an entry of its `PARTS`;
one more guide is a Markdown file in `guides`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
