"""Progress reports of long work; without a listener, the default, they cost nothing.

Work reports its activity with `report_progress`, and iterates over its parts with `each`; a command
line, say, listens with `progress_to`. Listeners belong to their context: other threads do not
report to them.
"""

import contextlib
from collections.abc import Callable, Iterable, Iterator
from contextvars import ContextVar
from typing import TypeVar

Item = TypeVar("Item")
#: (activity, number of parts done, number of parts or None).
Listener = Callable[[str, int, int | None], None]

_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


def report_progress(what: str, done: int = 0, total: int | None = None) -> None:
    """Report an activity, e.g. "testing stability", and the parts done out of a total."""
    listener = _listener.get()
    if listener is not None:
        listener(what, done, total)


def each(items: Iterable[Item], what: str, total: int | None = None) -> Iterator[Item]:
    """The items, with a report before each.

    Args:
      items: the parts of some work.
      what: name of the parts, e.g. "frames".
      total: their number, where it is known and the items have no length.
    """
    if total is None and hasattr(items, "__len__"):
        total = len(items)  # pyright: ignore[reportArgumentType]
    for done, item in enumerate(items):
        report_progress(what, done, total)
        yield item


@contextlib.contextmanager
def progress_to(listener: Listener) -> Iterator[None]:
    """A context whose reports go to a listener."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)
