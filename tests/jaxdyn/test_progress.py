"""Progress of long work: reported to those who listen, and without cost where nobody does."""

import threading

import jax

from jaxdyn._progress import each, progress_to, report_progress
from jaxdyn.accuracy import timing


def heard(work):
    found = []
    with progress_to(lambda what, done, total: found.append((what, done, total))):
        work()
    return found


def test_each_says_how_many_are_done():
    assert heard(lambda: list(each("ab", "letters"))) == [("letters", 0, 2), ("letters", 1, 2)]
    assert heard(lambda: list(each(iter("a"), "letters"))) == [("letters", 0, None)]
    assert heard(lambda: list(each(iter("a"), "letters", 7))) == [("letters", 0, 7)]


def test_nobody_listens_by_default_or_afterwards_or_elsewhere():
    assert list(each("ab", "letters")) == ["a", "b"]
    assert heard(lambda: report_progress("one thing")) == [("one thing", 0, None)]
    report_progress("another")

    def in_a_thread():
        thread = threading.Thread(target=lambda: report_progress("aside"))
        thread.start()
        thread.join()

    assert heard(in_a_thread) == []


def test_the_rounds_of_timing_are_told():
    found = heard(lambda: timing.interleave({"a": lambda: None}, 3))
    assert [done for _, done, total in found if total == 3] == [0, 1, 2]


def test_a_clock_knows_what_went_into_compiling():
    clock = timing.Clock()
    assert clock.compiling == 0.0
    jax.jit(lambda x: x * 3.25 + 1)(2.0).block_until_ready()
    assert 0.0 < clock.compiling < clock.seconds
    assert not clock.busy
    assert timing.Clock().compiling == 0.0
