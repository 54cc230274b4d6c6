"""What a page of the course consists of, the register of all pages, and how a page is run.

`content` has `Page`, which a page fills with numbers, checks, pictures and motions; `register`
reads titles, statements and the names that are used from the pages' own files, without running
them; `motions` has the equations of what is played; `extremes` finds the largest value of a
quantity along a motion; `running` runs a page and reports it; `showing` shows its motions in a
browser, and writes it as one file.
"""

import lazy_loader

# `jaxdyn list --problems` reads the register without loading JAX.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
