"""How far long work is, for whoever shows it; by default nobody listens, which costs nothing.

Work says what it does by `doing`, and goes through its parts by `each`; a command line, say,
listens by `told`. Listeners belong to their context: other threads hear nothing.
"""

import contextlib
from collections.abc import Callable, Iterable, Iterator
from contextvars import ContextVar
from typing import TypeVar

Item = TypeVar("Item")
#: (what is being done, how many parts are done, how many there are or None).
Listener = Callable[[str, int, int | None], None]

_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


def doing(what: str, done: int = 0, total: int | None = None) -> None:
    """Say what is being done, e.g. "testing stability", and of how many parts how many are done."""
    listener = _listener.get()
    if listener is not None:
        listener(what, done, total)


def each(items: Iterable[Item], what: str, total: int | None = None) -> Iterator[Item]:
    """The items, saying before each how many are done.

    Args:
      items: the parts of some work.
      what: they are, e.g. "frames".
      total: how many, where that is known and the items do not say it.
    """
    if total is None and hasattr(items, "__len__"):
        total = len(items)  # pyright: ignore[reportArgumentType]
    for done, item in enumerate(items):
        doing(what, done, total)
        yield item


@contextlib.contextmanager
def told(listener: Listener) -> Iterator[None]:
    """Tell a listener of what is done inside."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)
