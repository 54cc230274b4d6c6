"""Periodic motions with corners: smooth legs joined by events.

`legs` says what such a motion is, `search` closes it, `hopping` is the eccentric cylinder that
rolls and hops for ever.

May import: `shooting`.

One more such motion is one file that makes the `Leg`s of a `Hybrid`, as `hopping` does.
"""

from orbits.hybrid import hopping

__all__ = ["hopping"]
