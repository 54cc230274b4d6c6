"""Does any verdict on the stability of a published orbit contradict higher precision?

Run: ``python -m benchmarks verdicts [--count N] [--seed S]``. It draws orbits of three bodies from
``three_body_tables.csv``, finds each in doubles, asks `orbits.stability`, and compares its verdict
and the error bars of the multipliers with multipliers that are computed without this package: by
heyoka's Taylor method in Jacobi coordinates, in long doubles (64 bits), and in 113 bits where these
leave open the verdict, or a multiplier that is no larger than its bar, or contradict our bars.

All orbits retrace their path, rotated about the z axis with bodies 1 and 2 exchanged. So only half
a period is integrated; the other half is its image under S, and M = S P^-1 S P with the derivative
P over half a period. Over a whole period, close encounters would lose all digits. Results are added
one by one to ``verdicts.json`` beside this file; a row that is already there is not repeated, so
that an interrupted run continues. It needs heyoka and mpmath.

The table has all 2044 planar rows of the tables of three bodies that start in line (Li, Liao 2017,
Sci. China Phys. Mech. Astron. 60, 129511, equal masses; Li, Jing, Liao 2018, Publ. Astron. Soc.
Japan 70, 64, unequal), and every twentieth of the 10,059 rows in space (Li, Liao 2025,
arXiv:2508.08568), with the stability published there: S or U. The starts are (-1, 0, 0),
(1, 0, 0), (0, 0, z0) with velocities (vx, vy, vz), (vx, vy, -vz), -2 (vx, vy, 0) / m3; the masses
are 1, 1, m3, and G = 1.

The characteristic polynomial is divided by x - 1 as often as integrals and symmetries require: 4
times in the plane, 6 times in space. The quotient is palindromic in exact arithmetic, and hence a
polynomial in w = z + 1 / z; an orbit is linearly stable if all w are real, different and between -2
and 2. The deviation of the coefficients from a palindrome, and from those of the previous iterate,
estimates their error.

The file has the 200 orbits that are drawn with seed 0, and 16 of smaller draws. All were found. 64
bits settle 99 of the 200, and 113 bits 81 more, in some minutes each: no verdict contradicts them,
28 of the 180 were undecided in doubles, and all multipliers are within their bars. For 20, those of
close encounters, 113 bits do not suffice; all of them are undecided in doubles, too. So none of the
152 definite verdicts is without a reference. Four of the published verdicts are contradicted:
O_21(1.5), O_26(1.3), O_91(0.4) and O_836(1.0), S in the table, have the multipliers 1.000304,
1.00098, 1.000022 and 1.00000126.

The bars of the reference are estimates: in 64 bits it gave .99962 +- .02747i for the weakest pair
of O_755(0.7), with a bar of .0099. In 113 bits the pair is .99999974905 +- .00070844320i, to 1e-13;
`orbits.stability` says .99999975 +- .00070842i, with a bar of .001. Pairs within 1e-8 of 1 are
beyond 113 bits: for I.A^ic_47, which is not among the 200, they give 1 +- 9.8e-9 with a bar of
1.2e-9, where `orbits.refine` to 60 digits finds exp(+-1.41187e-14 i), and 72 digits the same.
"""

import csv
import functools
import itertools
import json
import math
import time
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import mpmath as mp
import numpy as np
import typer

import jaxdyn
import orbits
from jaxdyn.effects import PairGravity
from jaxdyn.formulations.newton import FreePoints

TABLE = Path(__file__).with_name("three_body_tables.csv")
STORED = Path(__file__).with_name("verdicts.json")
#: Bits, and the digits with which numbers are passed.
_DIGITS = {64: 21, 113: 36}
#: Tolerances of the steps; close encounters cost some ten digits of these.
_TOLERANCES = {64: 1e-19, 113: 1e-25}
#: Bars of the reference are the observed errors of its coefficients times this.
_SAFETY = 100.0
_STEPS, _WORKING = 8, 60
#: The largest relative correction of a published number; beyond, it is another orbit.
_MOVED = 1e-3


class Row(NamedTuple):
    """A row of the table, as printed there."""

    name: str
    m3: str
    z0: str
    vx: str
    vy: str
    vz: str
    period: str
    published: str

    @property
    def d(self) -> int:
        """Dimensions of space."""
        return 3 if self.published else 2

    @property
    def unknowns(self) -> tuple[str, ...]:
        """The numbers that are corrected; vz is 0 in the plane, as z0 is."""
        numbers = (self.z0, self.vx, self.vy, self.vz, self.period)
        return numbers if self.d == 3 else (self.vx, self.vy, self.period)


class Truth(NamedTuple):
    """The result of the reference for an orbit.

    Attributes:
      verdict: "stable", "unstable", or "open" if its digits do not suffice.
      multipliers: the non-trivial multipliers.
      bars: their error bars.
      bits: bits of the arithmetic.
      miss: distance of the state after a period from the start.
      moved: largest relative correction of the published numbers.
    """

    verdict: str
    multipliers: list[complex]
    bars: list[float]
    bits: int
    miss: float
    moved: float


def main(
    count: Annotated[int, typer.Option(help="Number of rows to draw.")] = 20,
    seed: Annotated[int, typer.Option(help="Of the draw.")] = 0,
    stored: Annotated[Path, typer.Option("--json", help="Results, also of earlier runs.")] = STORED,
) -> None:
    """Compare verdicts with higher precision; prints a line for each row, and the counts."""
    jaxdyn.configure()
    results = json.loads(stored.read_text()) if stored.is_file() else {}
    picked = draw(count, seed)
    for bits in _DIGITS:  # the slow arithmetic last, and only where the fast one leaves it open
        for row in picked:
            known = results.get(row.name)
            if known is None or (unsettled(known) and known["bits"] < bits):
                results[row.name] = compare(row, bits)
                stored.write_text(json.dumps(results, indent=1) + "\n")
                print(row.name, results[row.name], flush=True)
    print(summary([results[row.name] for row in picked]))


def unsettled(result: dict[str, Any]) -> bool:
    """Whether the reference needs more bits: for its verdict, a multiplier, or who is right."""
    return (
        result["truth"] == "open"
        or result.get("vague", False)
        or not result.get("within bars", True)
    )


def draw(count: int, seed: int) -> list[Row]:
    """Rows of the table, at random and without repetition; the quicker first."""
    with TABLE.open() as file:
        rows = [Row(**each) for each in csv.DictReader(file)]
    picked = np.random.default_rng(seed).choice(len(rows), count, replace=False)
    return sorted((rows[i] for i in picked), key=lambda row: float(row.period))


def compare(row: Row, bits: int) -> dict[str, Any]:
    """The results of both for a row, and whether they agree."""
    begin = time.process_time()
    found = orbits.find(scene(row), throw=False)
    result: dict[str, Any] = {"outcome": found.outcome.name, "published": row.published}
    if found.ok:
        linear = orbits.stability(found, throw=False)
        result |= {"verdict": linear.verdict, "growth": linear.growth, "unit": linear.unit}
    result["seconds"] = round(time.process_time() - begin, 1)
    exact = truth(row, bits)
    result |= {"truth": exact.verdict, "bits": exact.bits, "miss": exact.miss, "moved": exact.moved}
    if found.ok and exact.verdict != "open":
        off, bars = distances(exact, linear.nontrivial)
        same = abs(found.period / float(row.period) - 1) < _MOVED
        result |= {
            "vague": bool((bars >= np.abs(exact.multipliers)).any()),
            "same orbit": bool(same),
            "contradicts": bool(same and linear.verdict not in ("undecided", exact.verdict)),
            "within bars": bool((off <= linear.bars + bars).all()),
        }
    return result


def scene(row: Row) -> jaxdyn.Scene:
    """The scene of a row."""
    m3, z0, vx, vy, vz, period = map(float, row[1:7])
    r = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, z0]])[:, : row.d]
    v = np.array([[vx, vy, vz], [vx, vy, -vz], [-2 * vx / m3, -2 * vy / m3, 0.0]])[:, : row.d]
    y0 = np.concatenate([r.ravel(), v.ravel()])
    return jaxdyn.Scene(FreePoints((1.0, 1.0, m3), row.d), (PairGravity(1.0),), y0=y0, t1=period)


def distances(exact: Truth, ours: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(p,) distances of our multipliers to the exact ones, in the best pairing, and their bars."""
    if len(exact.multipliers) != len(ours):
        return np.full(len(ours), math.inf), np.zeros(len(ours))
    apart = np.abs(np.asarray(exact.multipliers)[:, None] - ours)
    orders = itertools.permutations(range(len(ours)))
    best = list(min(orders, key=lambda order: apart[list(order), range(len(ours))].sum()))
    return apart[best, range(len(ours))], np.asarray(exact.bars)[best]


def summary(results: list[dict[str, Any]]) -> str:
    """The counts."""

    def count(key: str, value: Any) -> int:
        return sum(each.get(key) == value for each in results)

    lines = [
        f"{len(results)} orbits: {count('outcome', 'FOUND')} found; the reference took more than "
        f"64 bits for {len(results) - count('bits', 64)}, and leaves {count('truth', 'open')} open",
        f"verdicts: {count('verdict', 'stable')} stable, {count('verdict', 'unstable')} unstable, "
        f"{count('verdict', 'undecided')} undecided; {count('contradicts', True)} contradictions",
        f"multipliers: within all bars for {count('within bars', True)} orbits, not for "
        f"{count('within bars', False)}",
    ]
    wrong = [e for e in results if e["published"] and e["truth"] != "open"]
    differ = sum((e["truth"] == "stable") != (e["published"] == "S") for e in wrong)
    return "\n".join([*lines, f"published S or U: {len(wrong)} compared, {differ} contradicted"])


def truth(row: Row, bits: int) -> Truth:
    """The result of the reference for a row."""
    with mp.workdps(_WORKING):
        given = u = mp.matrix([mp.mpf(x) for x in row.unknowns])
        seen: list[tuple[float, Any, Any]] = []
        for _ in range(_STEPS):
            missed, half, rate = _half(row, u, bits)
            seen.append((float(mp.norm(missed, mp.inf)), half, u))
            if len(seen) > 2 and not seen[-1][0] < seen[-2][0] / 2:
                break
            u = u - _correction(row, missed, half, rate)
        best, second = sorted(seen, key=lambda each: each[0])[:2]
        miss, _, u = best
        moved = max(float(abs(a - b) / (abs(b) or 1)) for a, b in zip(u, given, strict=True))
        if not (math.isfinite(miss) and moved < _MOVED):
            return Truth("open", [], [], bits, miss, moved)
        unit = 4 if row.d == 2 else 6
        return Truth(
            *judge([_nontrivial(row, x, unit) for _, x, _ in (best, second)]), bits, miss, moved
        )


def _nontrivial(row: Row, half, unit: int) -> list:
    """The characteristic polynomial over a period, without so many multipliers of 1."""
    image = mp.diag(_image(row.d))
    coefficients = characteristic(image * mp.inverse(half) * image * half)
    for _ in range(unit):
        coefficients = list(itertools.accumulate(coefficients[:-1]))
    return coefficients


def _image(d: int) -> list[int]:
    """The signs of the image S: exchanged, turned by pi about z, and backwards in time."""
    r, s = [1] * d, [-1] * d
    r[2:], s[2:] = [-1] * (d - 2), [1] * (d - 2)
    return [*r, *s, *s, *r]


def _correction(row: Row, missed, half, rate):
    """The correction of the unknowns by least squares, for which a few digits suffice."""
    ways = np.array(half.tolist(), float) @ _directions(row)
    slopes = np.column_stack([ways, np.array([float(x) for x in rate]) / 2])
    slopes = slopes[[sign < 0 for sign in _image(row.d)]]
    step = np.linalg.lstsq(slopes, np.array([float(x) for x in missed]), rcond=1e-13)[0]
    return mp.matrix(step.tolist())


def _directions(row: Row) -> np.ndarray:
    """(k, n) the derivatives of the start by the unknowns except the period."""
    d, pull = row.d, -(2 / float(row.m3) + 1)
    ways = np.zeros((4 * d, len(row.unknowns) - 1))
    first = d - 2  # of vx
    ways[3 * d, first], ways[3 * d + 1, first + 1] = pull, pull
    if d == 3:
        ways[5, 0], ways[8, 3] = 1.0, -2.0
    return ways


def _start(row: Row, u) -> list:
    """The state [r_2 - r_1, r_3 - (r_1 + r_2) / 2] with its velocities."""
    zero, pull = mp.mpf(0), -(2 / mp.mpf(row.m3) + 1)
    if row.d == 2:
        vx, vy, _ = u
        return [mp.mpf(2), zero, zero, zero, zero, zero, pull * vx, pull * vy]
    z0, vx, vy, vz, _ = u
    return [mp.mpf(2), zero, zero, zero, zero, z0, zero, zero, -2 * vz, pull * vx, pull * vy, zero]


def _half(row: Row, u, bits: int) -> tuple:
    """After half a period: the residual, the derivative by the start, and the rate."""
    runs, number = _integrator(row.d, bits)
    y0, k = _start(row, u), 4 * row.d
    runs.time, runs.pars[0] = number("0"), number(row.m3)
    for i, x in enumerate(y0):
        runs.state[i] = number(mp.nstr(x, _DIGITS[bits]))
    for i in range(k * k):
        runs.state[k + i] = number("1" if i % (k + 1) == 0 else "0")
    runs.propagate_until(number(mp.nstr(u[len(u) - 1] / 2, _DIGITS[bits])))
    numbers = [mp.mpf(str(x)) for x in runs.state]
    m = mp.matrix([numbers[i : i + k] for i in range(k, k + k * k, k)])
    missed = mp.matrix([x for x, sign in zip(numbers, _image(row.d), strict=False) if sign < 0])
    return missed, m, _rate(numbers[:k], mp.mpf(row.m3), mp.sqrt)


def _rate(y: list, m3: Any, sqrt: Any) -> list:
    """dy/dt of three bodies of masses 1, 1, m3, in Jacobi coordinates; numbers or expressions."""
    d = len(y) // 4
    r, s = y[:d], y[d : 2 * d]
    far = [b + a / 2.0 for a, b in zip(r, s, strict=True)]
    near = [b - a / 2.0 for a, b in zip(r, s, strict=True)]
    pulls = []
    for side in (r, far, near):
        square = sum(x * x for x in side[1:]) + side[0] * side[0]
        pulls.append([x / (square * sqrt(square)) for x in side])
    each = list(zip(*pulls, strict=True))
    first = [m3 * (c - b) - 2.0 * a for a, b, c in each]
    return [*y[2 * d :], *first, *(-(b + c) * (1.0 + m3 / 2.0) for _, b, c in each)]


@functools.cache
def _integrator(d: int, bits: int) -> tuple[Any, Any]:
    """heyoka's integrator with the variational equations, and the type of its numbers."""
    import heyoka as hy

    number = np.longdouble if bits == 64 else hy.real128
    y = list(hy.make_vars(*(f"{name}{i}" for name in "rsvw" for i in range(d))))
    field = list(zip(y, _rate(y, hy.par[0], hy.sqrt), strict=True))
    equations = hy.var_ode_sys(field, hy.var_args.vars, 1)
    zeros = np.zeros(4 * d, dtype=number)
    return hy.taylor_adaptive(
        equations, zeros, fp_type=number, tol=number(_TOLERANCES[bits]), compact_mode=True
    ), number


def characteristic(m) -> list:
    """The coefficients of the characteristic polynomial, highest first: Faddeev and LeVerrier."""
    n = m.rows
    found, b = [mp.mpf(1)], mp.eye(n)
    for k in range(1, n + 1):
        a = m * b
        found.append(-sum(a[i, i] for i in range(n)) / k)
        b = a + found[-1] * mp.eye(n)
    return found


def judge(seen: list[list]) -> tuple[str, list[complex], list[float]]:
    """The verdict, or "open", and the multipliers with bars.

    Args:
      seen: coefficients of the polynomial of the non-trivial multipliers, by two iterates, the
        better one first.
    """
    each = [x for c in seen for x in (c, [a / c[-1] for a in reversed(c)])]
    best = [(a + b) / 2 for a, b in zip(*each[:2], strict=True)]
    ws = sums(best)
    # The roots if the coefficients were wrong by that much.
    wrong = [[b + _SAFETY * (a - b) for a, b in zip(x, best, strict=True)] for x in each]
    others = [sums(x) for x in wrong]
    bars = [max(min(abs(w - o) for o in other) for other in others) for w in ws]
    values = [z for w in ws for z in both_of(w)]
    errors = [
        max(float(min(abs(z - x) for o in other for x in both_of(o))) for other in others)
        for z in values
    ]
    said = _verdict(list(zip(ws, bars, strict=True)))
    return said, [complex(z) for z in values], errors


def _verdict(pairs: list[tuple]) -> str:
    if any(abs(mp.im(w)) > bar or abs(mp.re(w)) - 2 > bar for w, bar in pairs):
        return "unstable"
    inside = all(2 - abs(mp.re(w)) > bar for w, bar in pairs)
    apart = all(abs(a - b) > e + f for (a, e), (b, f) in itertools.combinations(pairs, 2))
    return "stable" if inside and apart else "open"


def both_of(w) -> tuple:
    """The multipliers z and 1 / z with the sum w."""
    root = mp.sqrt(w * w - 4)
    z = (w + root) / 2 if mp.re(w) >= 0 else (w - root) / 2  # the larger, without cancellation
    return z, 1 / z


def sums(coefficients: list) -> list:
    """The w = z + 1 / z of the roots z of a palindrome of degree 4 or 6, by its first half."""
    _, a, b, c, *_ = coefficients
    rest = [a, b - 2] if len(coefficients) == 5 else [a, b - 3, c - 2 * a]
    n = len(rest)
    companion = mp.matrix(n, n)
    for i, x in enumerate(rest):
        companion[0, i] = -x
        if i:
            companion[i, i - 1] = 1
    return mp.eig(companion, left=False, right=False)


if __name__ == "__main__":
    typer.run(main)
