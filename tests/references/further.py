"""Choose the tests that `pytest` without arguments leaves out: `tests/further.txt`.

Kept are the quick tests and those of the project as a whole; then, always the one that adds most
lines of the packages for each second of processor time, as many as reach nearly all lines that the
tests reach together. It takes what every test reached and cost (pytest-cov, on a quiet machine)::

    python -m pytest -m 'not slow and not long' --cov=jaxdyn --cov=orbits --cov-context=test \\
        --cov-report= --costs=costs.json
    python tests/references/further.py .coverage costs.json

The first test that needs a program or a fixture pays for it; when it is left out, the next one
does. So the default run takes some 100 s more than the costs of the tests that are kept, and a
second round with costs of the kept ones gains nothing: it only passes that bill on.
"""

import json
import sys
from pathlib import Path

from coverage import CoverageData

QUICK = 0.3  # [s]
SHARE = 0.996  # of the lines that all tests reach: the last four in a thousand take minutes
FILE = Path(__file__).parents[1] / "further.txt"


def reach(data: CoverageData) -> dict[str, set[tuple[str, int]]]:
    """The lines that each test reaches."""
    lines = {}
    for file in data.measured_files():
        for line, contexts in data.contexts_by_lineno(file).items():
            for context in filter(None, contexts):  # importing has none
                lines.setdefault(context.rpartition("|")[0], set()).add((file, line))
    return lines


def choose(lines: dict[str, set], costs: dict[str, float]) -> set[str]:
    """The tests to keep."""
    lines = {test: reached for test, reached in lines.items() if test in costs}
    enough = SHARE * len(set().union(*lines.values()))
    kept = {test for test, cost in costs.items() if cost <= QUICK or test.startswith("tests/test_")}
    reached = set().union(*(lines.get(test, set()) for test in kept))
    while len(reached) < enough:
        test = max(lines.keys() - kept, key=lambda test: len(lines[test] - reached) / costs[test])
        reached |= lines[test]
        kept.add(test)
    return kept


def main(data_file: str, costs_file: str) -> None:
    """Write `tests/further.txt`."""
    data = CoverageData(data_file)
    data.read()
    costs = json.loads(Path(costs_file).read_text(encoding="utf-8"))
    left_out = sorted(costs.keys() - choose(reach(data), costs))
    FILE.write_text("\n".join(left_out) + "\n", encoding="utf-8")
    print(
        f"{len(left_out)} of {len(costs)} tests left out, {sum(costs[t] for t in left_out):.0f} s"
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
