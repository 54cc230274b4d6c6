"""The content of a page of the course, the register of all pages, and how a page is run.

`content` has `Page`, which a page fills with numbers, checks, pictures and motions; `register`
reads titles, statements and the names that are used from the pages' files, without running them;
`extremes` finds the largest value of a quantity along a motion; `running` runs a page and reports
its results; `showing` has the motions that are played with their equations, shows them in a
browser, and writes the page as a single file.
"""

import lazy_loader

import jaxdyn._doors

# `jaxdyn list --problems` reads the register without loading JAX.
_listed, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

#: Renamed in version 0.3.
_RENAMED = {"Played": "PlayedMotions"}
__getattr__ = jaxdyn._doors.attribute_getter(__name__, _listed, renamed=_RENAMED)
