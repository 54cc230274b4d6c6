"""Error against time of all methods, drawn from the stored run.

Run: ``python -m benchmarks.picture``. Reads ``last_run.json`` and writes ``work_precision.png``,
both beside this file; nothing is measured.
"""

import json
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.lines import Line2D

import jaxdyn
from benchmarks.default_method import repeats
from jaxdyn.accuracy.timing import pareto_front

STORED = Path(__file__).with_name("last_run.json")
PICTURE = Path(__file__).with_name("work_precision.png")
_COLUMNS = 3
_BEST = "jaxdyn, the best"
_COLOURS = {
    "jaxdyn": "C3",
    _BEST: "C1",
    "heyoka": "C0",
    "diffrax Dopri8": "C2",
    "diffrax Tsit5": "C8",
    "SciPy DOP853": "C7",
}


def draw(stored: dict, path: Path) -> None:
    """One panel per problem: minimum time over the true error, both logarithmic.

    Only problems that most methods solve are drawn; others answer separate questions.

    Args:
      stored: the output of ``python -m benchmarks --json``.
      path: path of the picture.
    """
    shown = {name: ways.keys() & _COLOURS.keys() for name, ways in stored["curves"].items()}
    most = max(map(len, shown.values()))
    curves = {name: stored["curves"][name] for name, ways in shown.items() if len(ways) == most}
    rows = -(-len(curves) // _COLUMNS)
    figure, axes = plt.subplots(
        rows, _COLUMNS, figsize=(4.2 * _COLUMNS, 3.2 * rows), squeeze=False, layout="constrained"
    )
    for ax, (name, methods) in zip(axes.flat, curves.items(), strict=False):
        methods = methods | of_long_calls(stored["curves"], name)
        for method, colour in _COLOURS.items():
            points = sorted(methods.get(method, []))
            if points:
                errors, seconds = zip(*points, strict=True)
                wide = 2.0 if method == "jaxdyn" else 1.0
                line = ".--" if method == _BEST else ".-"
                ax.loglog(errors, [1e3 * s for s in seconds], line, color=colour, lw=wide)
        ax.set(title=name, xlim=(1e-3, 1e-16))
        ax.grid(alpha=0.3)
    for ax in axes.flat[len(curves) :]:
        ax.axis("off")
    for ax in axes[-1]:
        ax.set_xlabel("true error")
    for ax in axes[:, 0]:
        ax.set_ylabel("time [ms]")
    lines = [Line2D([], [], color=colour) for colour in _COLOURS.values()]
    names = [{"jaxdyn": "jaxdyn, the default"}.get(name, name) for name in _COLOURS]
    figure.legend(lines, names, loc="outside lower center", ncols=len(_COLOURS))
    figure.savefig(path, dpi=90)
    plt.close(figure)


def of_long_calls(curves: dict, name: str) -> dict[str, list[tuple[float, float]]]:
    """The default, the best of all our solvers, and heyoka, as `benchmarks default` measures them.

    There a call solves from several starts, so that its overhead, which is about as long as a
    period of the figure-eight, does not count. The best are the runs that are more accurate than
    every faster one.
    """
    methods = curves.get(f"default: {name}", {})
    ours = {method: runs for method, runs in methods.items() if "heyoka" not in method}
    if not ours:
        return {}
    every = [run for runs in ours.values() for run in runs]
    found = {
        "jaxdyn": next(runs for method, runs in ours.items() if method.startswith("default")),
        _BEST: [every[i] for i in pareto_front(*zip(*every, strict=True))],
    }
    if "heyoka" in methods:
        found["heyoka"] = methods["heyoka"]
    n = repeats(name)
    return {
        method: [(error, seconds / n) for error, seconds in runs] for method, runs in found.items()
    }


if __name__ == "__main__":
    jaxdyn.configure()
    draw(json.loads(STORED.read_text()), PICTURE)
