"""Steps along a family or a curve: their length, the special points between, and why it ends.

What is followed says how the next member is found (`Rules`). The members are kept in a file if
there is one (`checkpoint`), from which an interrupted walk goes on.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from jaxdyn.continuation.checkpoint import Advance, Codec, Kept, Stored

_INTERRUPTED = "an interruption"
_CLOSED = "the first one again: it is closed"
_EASY = 4  # with at most this many Newton steps the next step may be longer
_GROW, _SHRINK = 1.5, 0.5
_LONGEST = 10.0  # of the first step: longest step


class Rules(NamedTuple):
    """How a family or a curve is followed.

    Attributes:
      following: (member, step) -> the member a step further, and by what factor the next step may
        be longer; None for the member where there is none.
      between: (a, b, first) -> the special points between two neighbours; with `first` also one at
        `a`.
      before: (member, special) -> why the walk ends without this member; "" if it does not.
      after: member -> why the walk ends with it; "" if it does not.
      again: (a, b) -> the first member of the walk, as it is met again between two neighbours; None
        if it is not.
      ready: member -> the same one, as the next step starts from it.
      lost: (member, step) -> why the walk ends where no member is found, however short the step.
      shortest: of the first step: smallest step.
    """

    following: Callable[[Any, float], tuple[Any, float]]
    between: Callable[[Any, Any, bool], list]
    before: Callable[[Any, list], str]
    after: Callable[[Any], str]
    lost: Callable[[Any, float], str]
    again: Callable[[Any, Any], Any] = lambda a, b: None
    ready: Callable[[Any], Any] = lambda member: member
    shortest: float = 1e-4


class Walked(NamedTuple):
    """The result of a walk.

    Attributes:
      members: one per step.
      special: the special points between them.
      before: the number of members before each special point.
      end: why it ends.
    """

    members: tuple
    special: tuple
    before: tuple[int, ...]
    end: str


def walked(
    rules: Rules, first, step: float, most: int, report: Callable, kept: Kept | None = None
) -> Walked:
    """At most `most` members from the first one on."""
    members, special, before = [first], [], []
    report(first)
    end = f"the number of members requested, {most}"
    advances = _advances(rules, first, step, kept)
    while len(members) < most:
        advance = next(advances)
        special += advance.special
        before += [len(members)] * len(advance.special)
        if advance.member is None:
            end = advance.end
            break
        members.append(advance.member)
        report(advance.member)
        after = rules.after(advance.member)
        if after:
            end = after
            break
    if kept is not None:
        kept.ended(end)
    return Walked(tuple(members), tuple(special), tuple(before), end)


def read(walk: Stored, codec: Codec) -> Walked:
    """A walk as its file has it."""
    first, advances = walk.read(codec)
    members, special, before = [first], [], []
    for advance in advances:
        special += advance.special
        before += [len(members)] * len(advance.special)
        members += [] if advance.member is None else [advance.member]
    end = walk.end or _INTERRUPTED
    return Walked(tuple(members), tuple(special), tuple(before), end)


def _advances(rules: Rules, first, step: float, kept: Kept | None) -> Iterator[Advance]:
    """The steps from the first member on: those of the file, then new ones."""
    last, length, fresh = first, step, True
    for advance in () if kept is None else kept.advances:
        yield advance
        last, length, fresh = advance.member, advance.step, False
    while True:
        advance = _advance(rules, last, length, step, fresh)
        if kept is not None:
            kept.add(advance)
        yield advance
        last, length, fresh = advance.member, advance.step, False


def _advance(rules: Rules, last, length: float, step: float, fresh: bool) -> Advance:
    """The next step, which is shorter where no member is found at its length."""
    while True:
        new, factor = rules.following(last, length)
        if new is not None:
            break
        length *= _SHRINK
        if length < rules.shortest * step:
            return Advance(None, [], length, rules.lost(last, length))
    first = rules.again(last, new)
    special = rules.between(last, new if first is None else first, fresh)
    end = rules.before(new, special) or (_CLOSED if first is not None else "")
    new = None if end else rules.ready(new)
    return Advance(new, special, min(factor * length, _LONGEST * step), end)


def growth(iterations: int) -> float:
    """By what factor a step may be longer after one that so many Newton steps have corrected."""
    return _GROW if iterations <= _EASY else 1.0


def outside(values, within: Sequence[tuple[float, float]]) -> str:
    """Why a walk ends with parameters, if they are beyond their bounds; else ""."""
    inside = all(low <= x <= high for x, (low, high) in zip(values, within, strict=True))
    return "" if inside else f"the bounds {within}"
