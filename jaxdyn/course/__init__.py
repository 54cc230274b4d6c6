"""The course: 61 problems, one runnable page each.

The docstring of a page states the problem and its answer; its ``solve(page)`` computes the answer
with the public API, checks it independently, and draws it. ``jaxdyn course 16`` or ``python -m
jaxdyn.course.circling_bodies`` runs one. Files are named after what they show, `PROBLEM` in them is
their number, and ``jaxdyn list --problems`` lists both. `tests/jaxdyn/course/test_pages.py` runs
all of them. The folder `page` defines the content of a page and reads the register, `problems()`,
from the files.

May import: `hard`, `player`, `drawing`, `symbolic`; and `orbits`.

To add a page, write a file here with a docstring of title, statement, "Answer: " and the solution
of each part; `PROBLEM` and `TOPIC` (one of `page.TOPICS`); and `solve`, which passes functions
that draw its pictures, so that the command does not wait for pictures that it does not show. Checks
that take long go into ``check(page)``, which runs with ``--check``; questions about a motion that
runs in a browser, "What happens when ...?", go into ``ask(page)``. Figures in the text have to be
rounded numbers of the page, which the test checks.
"""

import lazy_loader

# `jaxdyn list --problems` shows the register without loading JAX.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
