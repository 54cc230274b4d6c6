"""What the default run leaves out, and what each test costs.

A test that takes more than `LIMIT` is marked `slow`. Of a test with many cases the default run may
take a sample: `@pytest.mark.sample("top", "pendulum")` names the cases that it keeps, and marks
the others `slow`. At the end of a run the tests above the limit that are not marked are listed:
their processor time, which a busy machine doubles, so nothing fails unless `--cost-limit` asks.

A run of everything also leaves out the tests of `further.txt`, which get the mark `further`: they
take long, and together reach four in a thousand lines that the others do not
(`references/further.py` chooses them). Whoever names a file or folder to test gets them, too.
"""

import json
import os
from collections import defaultdict
from pathlib import Path

import pytest

LIMIT = 3.0  # [s] of processor time
FURTHER = Path("tests/further.txt")  # in the root folder

_START = pytest.StashKey[float]()
_LEFT_OUT = {"slow", "long"}


def pytest_addoption(parser):
    parser.addoption(
        "--cost-limit",
        type=float,
        metavar="SECONDS",
        help="fail if a test that is not marked slow takes more processor time than this",
    )
    parser.addoption(
        "--costs",
        type=Path,
        metavar="FILE",
        help="write the processor time of each test to a file, as JSON",
    )


def pytest_configure(config):
    if not hasattr(config, "workerinput"):  # not one of several processes that run tests
        config.pluginmanager.register(_Report(config))


@pytest.hookimpl(tryfirst=True)  # before `-m` looks at the marks
def pytest_collection_modifyitems(config, items):
    sampled = defaultdict(list)
    for item in items:
        if mark := item.get_closest_marker("sample"):
            sampled[item.nodeid.partition("[")[0]].append(item.callspec.id)
            if item.callspec.id not in mark.args:
                item.add_marker(pytest.mark.slow)
    if set(config.args) == set(config.getini("testpaths")):
        _mark_further(items, config.rootpath / FURTHER)
    if any("[" in arg for arg in config.args):
        return  # single cases were asked for
    for item in items:
        if mark := item.get_closest_marker("sample"):
            name = item.nodeid.partition("[")[0]
            if unknown := set(mark.args).difference(sampled[name]):
                raise pytest.UsageError(f"{name} has no cases {sorted(unknown)} to sample.")


def _mark_further(items, file):
    """Mark the tests that a file names; each has to exist, where its file is not skipped."""
    further = set(file.read_text(encoding="utf-8").splitlines())
    for item in items:
        if item.nodeid in further:
            item.add_marker(pytest.mark.further)
    files = {item.nodeid.partition("::")[0] for item in items}
    further -= {item.nodeid for item in items}
    if further := {test for test in further if test.partition("::")[0] in files}:
        raise pytest.UsageError(
            f"{FURTHER}: there is no test {min(further)}. Correct its line, or take it out."
        )


def _processor_time() -> float:
    """The processor time of this process and of those that it has waited for [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item):
    item.stash[_START] = _processor_time()
    return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item):
    try:
        return (yield)
    finally:  # the properties of a test travel from the process that ran it to the one that reports
        item.user_properties.append(("cost", _processor_time() - item.stash[_START]))


class _Report:
    """Collects the costs where the results of all processes arrive."""

    def __init__(self, config):
        self.limit = config.getoption("--cost-limit")
        self.file = config.getoption("--costs")
        self.costs = {}

    def pytest_runtest_logreport(self, report):
        if report.when == "teardown" and not _LEFT_OUT & report.keywords.keys():
            self.costs[report.nodeid] = dict(report.user_properties).get("cost", 0.0)

    def _above(self):
        limit = LIMIT if self.limit is None else self.limit
        above = {test: cost for test, cost in self.costs.items() if cost > limit}
        return limit, sorted(above.items(), key=lambda pair: -pair[1])

    def pytest_sessionfinish(self, session):
        if self.file is not None:
            self.file.write_text(json.dumps(self.costs, indent=0), encoding="utf-8")
        if self.limit is not None and self._above()[1] and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter):
        limit, above = self._above()
        if not above:
            return
        terminalreporter.section(f"more than {limit:g} s of processor time, and not marked slow")
        for test, cost in above:
            terminalreporter.write_line(f"{cost:6.1f} s  {test}")
