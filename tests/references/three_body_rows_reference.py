"""High-precision reference numbers for the published periodic orbits of three equal bodies.

The rows of `published_three_body.csv` are from the tables of X. Li and S. Liao, "More than six
hundred new families of Newtonian periodic planar collisionless three-body orbits", Sci. China
Phys. Mech. Astron. 60, 129511 (2017). They give 10 digits of v1, v2 and the period T, some of them
off by up to 2e-7, and the free-group word; the bodies start
at (-1, 0), (1, 0), (0, 0) with velocities (v1, v2), (v1, v2), (-2 v1, -2 v2), and G m = 1. The
script is self-contained: it uses nothing of the package whose tests its numbers serve.

What it computes: v1, v2 and T for which the state after T is the start, by Gauss-Newton steps on
all twelve entries. The states come from heyoka's MPFR Taylor integrator in the plain cartesian
equations, the Jacobian (good to a few digits is good enough) from its variational equations in
long doubles. From them T |E|^(3/2), which no scaling of the orbit changes.

How it is checked: the last step must be smaller than AGREE relative to T, at precision BITS; rows
whose Jacobian loses all digits (multipliers of 1e12) are reported and left out.

Run:  python three_body_rows_reference.py [--output FILE]
It needs heyoka (built with MPFR), numpy and mpmath, and takes about half an hour on one core.
"""

import argparse
import csv
import json
from pathlib import Path

import heyoka as hy
import mpmath as mp
import numpy as np

ROWS = Path(__file__).parents[1] / "published_three_body.csv"
BITS = 113
AGREE = 1e-18
STEPS = 6


def system():
    """Equations of motion of three bodies in the plane."""
    var = hy.make_vars(*"x1 y1 x2 y2 x3 y3 u1 v1 u2 v2 u3 v3".split())
    pos, vel = var[:6], var[6:]
    terms = [[] for _ in range(6)]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        d = [pos[2 * j + k] - pos[2 * i + k] for k in (0, 1)]
        square = hy.sum([d[0] * d[0], d[1] * d[1]])
        cube = square * hy.sqrt(square)
        for k in (0, 1):
            terms[2 * i + k].append(d[k] / cube)
            terms[2 * j + k].append(-d[k] / cube)
    forces = [hy.sum(t) for t in terms]
    return [*zip(pos, vel, strict=True), *zip(vel, forces, strict=True)]


def number(x):
    """For heyoka, at the working precision."""
    return hy.real(mp.nstr(x, mp.mp.dps), BITS)


def start(a, b):
    """The twelve entries of a row's start."""
    zero, one = mp.mpf(0), mp.mpf(1)
    return [-one, zero, one, zero, zero, zero, a, b, a, b, -2 * a, -2 * b]


def slopes(variational, a, b, period):
    """(12, 3) derivative of y(T) - y(0) by v1, v2 and T."""
    y0 = np.array([np.longdouble(mp.nstr(x, 20)) for x in start(a, b)])
    variational.time = np.longdouble(0)
    variational.state[:12] = y0
    variational.state[12:] = np.eye(12).ravel()
    variational.propagate_until(np.longdouble(mp.nstr(period, 20)))
    y, m = variational.state[:12].copy(), variational.state[12:].reshape(12, 12)
    ways = np.zeros((12, 2))
    ways[[6, 8, 10], 0] = ways[[7, 9, 11], 1] = 1, 1, -2
    rate, q = np.concatenate([y[6:], np.zeros(6)]), y[:6].reshape(3, 2)
    for i in range(3):
        for j in range(3):
            if i != j:
                d = q[j] - q[i]
                rate[6 + 2 * i : 8 + 2 * i] += d / np.sqrt(d @ d) ** 3
    return np.column_stack([(m - np.eye(12)) @ ways, rate]).astype(float)


def polished(exact, variational, a, b, period):
    """v1, v2, T that close, and the last relative step."""
    inverse = np.linalg.pinv(slopes(variational, a, b, period))
    for _ in range(STEPS):
        y0 = start(a, b)
        exact.time = hy.real(0, BITS)
        for k, value in enumerate(y0):
            exact.state[k] = number(value)
        exact.propagate_until(number(period))
        miss = [mp.mpf(str(y)) - x for y, x in zip(exact.state, y0, strict=True)]
        size = max(abs(m) for m in miss)
        scaled = np.array([float(m / size) for m in miss])
        step = [-size * mp.mpf(float(s)) for s in inverse @ scaled]
        a, b, period = a + step[0], b + step[1], period + step[2]
        last = float(max(abs(s) for s in step) / period)
        if last < AGREE:
            break
    return a, b, period, last


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--output", default="three_body_rows_reference.json")
    args = parser.parse_args()
    mp.mp.dps = int(BITS / 3.32) + 2
    equations = system()
    y0 = [number(x) for x in start(mp.mpf("0.3"), mp.mpf("0.5"))]
    exact = hy.taylor_adaptive(equations, y0, fp_type=hy.real, prec=BITS)
    wide = hy.var_ode_sys(equations, args=hy.var_args.vars, order=1)
    y0 = [np.longdouble(mp.nstr(x, 20)) for x in start(mp.mpf("0.3"), mp.mpf("0.5"))]
    variational = hy.taylor_adaptive(wide, y0, fp_type=np.longdouble, compact_mode=True)
    result = {}
    for row in csv.DictReader(ROWS.read_text().splitlines()):
        guess = (mp.mpf(row[key]) for key in ("v1", "v2", "period"))
        a, b, period, last = polished(exact, variational, *guess)
        print(row["name"], last, flush=True)
        if last > AGREE:
            continue
        energy = -mp.mpf(5) / 2 + 3 * (a * a + b * b)
        texts = (mp.nstr(x, 18) for x in (a, b, period, period * abs(energy) ** mp.mpf("1.5")))
        result[row["name"]] = dict(zip(("v1", "v2", "period", "scale_free"), texts, strict=True))
        with open(args.output, "w") as file:
            json.dump(result, file, indent=1)


if __name__ == "__main__":
    main()
