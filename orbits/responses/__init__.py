"""Nonlinear vibrations: frequency responses and backbone curves.

`response` follows the forced responses of a scene over the forcing frequency, `backbone` its
nonlinear normal modes: free vibrations that begin at a linear mode, over the energy. Both are
families of periodic orbits, with their folds, branch points and stability; `resonances` finds where
the frequencies of two modes have a simple ratio.

May import: `families`, `discovery`.

To add a kind of curve, write a file that poses it as a family.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
