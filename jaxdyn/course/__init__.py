"""The course: 61 problems, one runnable page each.

The docstring of a page states the problem and its answer; its ``solve(page)`` computes it by the
public API, checks it by another route, and draws it. ``jaxdyn course 16`` and ``python -m
jaxdyn.course.circling_bodies`` run one; files are named by what they show, their number is
`PROBLEM` in them, and ``jaxdyn list --problems`` has both. One test runs them all,
`tests/jaxdyn/course/test_pages.py`. The folder `page` says what a page consists of and reads the
register, `problems()`, from the files.

May import: `hard`, `player`, `drawing`, `symbolic`; and `orbits`.

One more page is one more file here: a docstring of title, statement, "Answer: " and the solution of
each part; `PROBLEM` and `TOPIC` (one of `page.TOPICS`); and `solve`. Checks that take long go into
``check(page)``, which runs with ``--check``; questions to a motion that runs in a browser, "What
happens when ...?", into ``ask(page)``. Figures in the text are roundings of the page's
numbers, which the test checks.
"""

import lazy_loader

# `jaxdyn list --problems` shows the register without loading JAX.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
