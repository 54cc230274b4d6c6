"""Answers to questions about single scenes that are computations of their own.

`rod_or_spring` (is a rod or a stiff spring the better link), `upright` (when a shaking base
stabilises an inverted pendulum), `satellite_claims` (which claims about three satellites hold),
`sleeping_top` (how fast a top must spin to stand upright).

May import: `accuracy`, `scenes`.

One more study is a file of its own and one line in the stub beside this file.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
