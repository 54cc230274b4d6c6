"""High-precision motions of chaotic scenes, to which trusted times are held.

Problems: a double and a triple pendulum of uniform bars of mass 1 and length 1 in gravity 1, from
rest at the angles of the package's scenes; and the figure eight of three equal masses (G = 1)
with the first body moved by PUSH along x. The script is self-contained: it uses nothing of the
package whose tests its numbers serve.

The pendulums: bar i has its centre at the sum of the l_j e(a_j) above it and half its own, so

    M_ij = c_ij cos(a_i - a_j),   M a'' = -(sum_j c_ij sin(a_i - a_j) a_j'^2) - b_i g sin(a_i)

with c_ij = l_i l_j (m_i / 2 [i = j: m_i / 3] + masses below), for i >= j, and b_i = l_i (m_i / 2 +
masses below); solved by Cramer's rule. By heyoka's MPFR Taylor integrator, at two precisions,
which must agree to AGREE digits.

Run:  python chaos_reference.py [--output FILE]
It needs heyoka (built with MPFR) and mpmath, and takes some minutes on one core.
"""

import argparse
import json

import heyoka as hy
import mpmath as mp

PENDULUMS = {
    "double": {"angles": ("1.5707963267948966", "3.141592653589793"), "t1": 100, "samples": 101},
    "triple": {
        "angles": ("1.5707963267948966", "3.141592653589793", "2.0"),
        "t1": 50,
        "samples": 101,
    },
}
EIGHT = {"t1": 300, "samples": 101}
#: Figure eight, to the digits of doubles: r1 = -r2, r3 = 0, v1 = v2 = -v3 / 2.
R1 = ("-0.97000436", "0.24308753")
V3 = ("0.93240737", "0.86473146")
PUSH = "0.05"
DIGITS = (60, 80)
AGREE = 25
WRITTEN = 20


def _number(value, prec):
    return hy.real(mp.nstr(mp.mpf(value), mp.mp.dps), prec)


def _exact(text):
    """The double that a decimal number is read as, exactly."""
    return mp.mpf(float(text))


def _determinant(rows):
    if len(rows) == 1:
        return rows[0][0]
    terms = []
    for k, head in enumerate(rows[0]):
        minor = [[x for j, x in enumerate(row) if j != k] for row in rows[1:]]
        terms.append((1.0 if k % 2 == 0 else -1.0) * head * _determinant(minor))
    return sum(terms[1:], terms[0])


def _pendulum(n, prec):
    a = hy.make_vars(*(f"a{i}" for i in range(n)))
    w = hy.make_vars(*(f"w{i}" for i in range(n)))

    def inertia(i, j):
        below = n - 1 - max(i, j)
        return _number((mp.mpf(1) / 3 if i == j else mp.mpf(1) / 2) + below, prec)

    def cos(i, j):
        return 1.0 if i == j else hy.cos(a[i] - a[j])

    mass = [[inertia(i, j) * cos(i, j) for j in range(n)] for i in range(n)]
    force = []
    for i in range(n):
        swing = [-inertia(i, j) * hy.sin(a[i] - a[j]) * w[j] * w[j] for j in range(n) if j != i]
        weight = -_number(mp.mpf(1) / 2 + (n - 1 - i), prec) * hy.sin(a[i])
        force.append(hy.sum([*swing, weight]))
    det = _determinant(mass)
    turned = []
    for k in range(n):
        rows = [[force[i] if j == k else mass[i][j] for j in range(n)] for i in range(n)]
        turned.append(_determinant(rows) / det)
    return [*zip(a, w, strict=True), *zip(w, turned, strict=True)]


def _eight():
    names = [
        *(f"r{i}{c}" for i in range(3) for c in "xy"),
        *(f"v{i}{c}" for i in range(3) for c in "xy"),
    ]
    var = hy.make_vars(*names)
    pos, vel = var[:6], var[6:]
    terms = [[] for _ in range(6)]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        d = [pos[2 * j + k] - pos[2 * i + k] for k in (0, 1)]
        square = hy.sum([d[0] * d[0], d[1] * d[1]])
        cube = square * hy.sqrt(square)
        for k in (0, 1):
            terms[2 * i + k].append(d[k] / cube)
            terms[2 * j + k].append(-1.0 * d[k] / cube)
    return [*zip(pos, vel, strict=True), *((v, hy.sum(t)) for v, t in zip(vel, terms, strict=True))]


def eight_start():
    """(12) the start of the pushed eight: the doubles nearest to these decimals."""
    x, y = (float(text) for text in R1)
    u, v = (float(text) for text in V3)
    return [x + float(PUSH), y, -x, -y, 0.0, 0.0, -u / 2, -v / 2, -u / 2, -v / 2, u, v]


def follow(system, start, t1, samples, digits):
    """(samples, k) states at even times from 0 to t1, as mpmath numbers."""
    prec = int(digits * 3.3219281) + 8
    system = system(prec)
    ta = hy.taylor_adaptive(
        system, [_number(x, prec) for x in start], fp_type=hy.real, prec=prec, compact_mode=True
    )
    rows = []
    for n in range(samples):
        ta.propagate_until(_number(mp.mpf(t1) * n / (samples - 1), prec))
        rows.append([mp.mpf(str(v)) for v in ta.state])
    return rows


def trusted(system, start, t1, samples):
    low, high = (follow(system, start, t1, samples, digits) for digits in DIGITS)
    gap = max(abs(a - b) for x, y in zip(low, high, strict=True) for a, b in zip(x, y, strict=True))
    if gap > mp.mpf(10) ** -AGREE:
        raise RuntimeError(f"the two precisions differ by {mp.nstr(gap, 3)}")
    return {
        "t1": t1,
        "precisions_agree_to": mp.nstr(gap, 3),
        "states": [[mp.nstr(v, WRITTEN) for v in row] for row in high],
    }


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--output", default="chaos_reference.json")
    args = parser.parse_args()
    mp.mp.dps = DIGITS[1] + 5
    result = {}
    for name, case in PENDULUMS.items():
        n = len(case["angles"])
        start = [_exact(x) for x in case["angles"]] + [mp.mpf(0)] * n
        result[name] = trusted(
            lambda prec, n=n: _pendulum(n, prec), start, case["t1"], case["samples"]
        )
    start = [mp.mpf(x) for x in eight_start()]
    result["eight"] = trusted(lambda _prec: _eight(), start, EIGHT["t1"], EIGHT["samples"])
    with open(args.output, "w") as file:
        json.dump(result, file, indent=0)


if __name__ == "__main__":
    main()
