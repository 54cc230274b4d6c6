"""What do digits beyond double precision cost?

Run: ``python -m benchmarks digits``; ``python -m benchmarks.digits`` draws ``digits.png`` from the
stored times. The figure-eight, of twelve numbers, as a choreography: start, period and multipliers
by `orbits.refine`, and the proof that it exists and is stable by `orbits.prove`. Times are
processor times once the formulas are known, so that other load does not count. The target is 100
digits in 60 s.

Last numbers (2 cores, 2026-11): `refine` 1.0 s to 15 digits, 1.9 s to 30, 3.7 s to 50, 13 s to 100:
100 digits take 6.7 times as long as 30. `prove` 8.4, 9.3 and 16 s, with 161, 211 and 277 bits;
stability is undecided at 15 digits, proved above. No longer measured: 200 digits, which took 86 s,
and the proof of 100, which took 68 s with 443 bits.
"""

import functools
import time
from collections.abc import Callable

import matplotlib.pyplot as plt

import orbits
from benchmarks._timing import Row, Times
from benchmarks.picture import STORED
from jaxdyn.scenes import three_body

DIGITS, _QUICK = (15, 30, 50, 100), (15,)
_MOST_PROVED = 50  # digits of proofs
_BAR, _BAR_DIGITS = 60.0, 100
PICTURE = STORED.with_name("digits.png")


def run(quick: bool = False) -> list[Row]:
    """Times of refinements and proofs, and their ratios to those for 30 digits."""
    orbit = eight()
    orbits.refine(orbit, 15)  # everything is loaded
    rows: list[Row] = []
    for digits in _QUICK if quick else DIGITS:
        spent, refined = _seconds(functools.partial(orbits.refine, orbit, digits))
        times, note = {"refine": spent}, f"{refined.digits} digits"
        if digits <= _MOST_PROVED:
            times["prove"], proof = _seconds(functools.partial(orbits.prove, orbit, digits))
            note += f", proof with {proof.bits} bits: {proof.verdict}"
        if digits == _BAR_DIGITS:
            kept = "kept" if spent.minimum < _BAR else "missed"
            ratio = spent.minimum / rows[1].times["refine"].minimum
            note += f"; {_BAR:.0f} s {kept}, {ratio:.1f} times as long as 30 digits"
        rows.append(Row(f"digits: {digits}", times, note=note))
    return rows


def eight() -> orbits.Orbit:
    """The figure-eight in doubles."""
    return orbits.find(three_body(), closing=orbits.choreography(3))


def _seconds(work: Callable) -> tuple[Times, orbits.proof.Refined | orbits.proof.Certificate]:
    start = time.process_time()
    found = work()
    spent = time.process_time() - start
    return Times(spent, spent), found


def draw(seconds: dict, path) -> None:
    """Time over the number of digits, both logarithmic.

    Args:
      seconds: by row and method, as ``python -m benchmarks --json`` stores them.
      path: of the picture.
    """
    figure, ax = plt.subplots(figsize=(5.6, 3.8), layout="constrained")
    for method, colour in (("refine", "C3"), ("prove", "C0")):
        points = [
            (digits, seconds[f"digits: {digits}"][method]["minimum"])
            for digits in DIGITS
            if method in seconds.get(f"digits: {digits}", {})
        ]
        if points:
            ax.loglog(*zip(*points, strict=True), ".-", color=colour, label=method)
    ax.plot(_BAR_DIGITS, _BAR, "kx", label="the target: 100 digits in 60 s")
    ax.set(xlabel="digits", ylabel="processor time [s]", title="The cost of a digit of the eight")
    ax.set_xticks(DIGITS, [str(n) for n in DIGITS])
    ax.minorticks_off()
    ax.grid(alpha=0.3)
    ax.legend()
    figure.savefig(path, dpi=120)
    plt.close(figure)


if __name__ == "__main__":
    import json

    draw(json.loads(STORED.read_text())["seconds"], PICTURE)
