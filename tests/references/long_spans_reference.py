"""Long motions and derivatives in high precision, to which error estimates are held.

Problems: two motions in the potential of Henon and Heiles, r^2 / 2 + x^2 y - y^3 / 3, from the
starts below: a regular one of energy near 1/12 and a chaotic one of energy near 1/6; the Lorenz
system from (1, 1, 1) and its derivative by rho; the figure eight of three equal masses, G = 1, and
its derivative by G. All numbers are the doubles nearest to the decimals below. The script is
self-contained: it uses nothing of the package whose tests its numbers serve.

Derivatives are those of the variational equations d' = (df/dy) d + df/dp, written out by symbolic
differentiation. By heyoka's MPFR Taylor integrator at two precisions, which must agree to AGREE
digits.

Run:  python long_spans_reference.py [--output FILE]
It needs heyoka (built with MPFR), and takes some minutes on one core.
"""

import argparse
import json

import heyoka as hy

PRECISIONS = (200, 260)  # bits
AGREE = 1e-25
HENON = {
    "regular": ([0.0, 0.1, 0.397073040, 0.0], [30.0, 300.0, 3000.0]),
    "chaotic": ([0.0, -0.2, 0.52, 0.1], [50.0, 100.0, 200.0]),
}
LORENZ = ([1.0, 1.0, 1.0], [28.0, 10.0, 8 / 3], [1.0, 5.0, 10.0, 20.0])
X, Y, U, V = 0.97000436, 0.24308753, 0.93240737, 0.86473146
EIGHT_START = [-X, Y, X, -Y, 0.0, 0.0, -U / 2, -V / 2, -U / 2, -V / 2, U, V]
EIGHT = (EIGHT_START, [1.0], [6.3, 31.6, 63.3])


def henon():
    x, y, u, v = hy.make_vars("x", "y", "u", "v")
    return [(x, u), (y, v), (u, -1.0 * x - 2.0 * x * y), (v, y * y - y - x * x)]


def lorenz():
    x, y, z = hy.make_vars("x", "y", "z")
    rho, sigma, beta = (hy.par[i] for i in range(3))
    return [(x, sigma * (y - x)), (y, x * (rho - z) - y), (z, x * y - beta * z)]


def eight():
    pos = hy.make_vars(*(f"r{i}" for i in range(6)))
    vel = hy.make_vars(*(f"v{i}" for i in range(6)))
    pulls = [[] for _ in range(6)]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        d = [pos[2 * j + k] - pos[2 * i + k] for k in (0, 1)]
        square = d[0] * d[0] + d[1] * d[1]
        for k in (0, 1):
            pull = d[k] / (square * hy.sqrt(square))
            pulls[2 * i + k].append(pull)
            pulls[2 * j + k].append(-1.0 * pull)
    moving = [(v, hy.par[0] * hy.sum(p)) for v, p in zip(vel, pulls, strict=True)]
    return [*zip(pos, vel, strict=True), *moving]


def with_derivative(system):
    """The system and its derivative by the first parameter."""
    tangents = hy.make_vars(*(f"d{i}" for i in range(len(system))))
    rows = []
    for tangent, (_, rate) in zip(tangents, system, strict=True):
        slope = hy.diff(rate, hy.par[0])
        for other, (variable, _) in zip(tangents, system, strict=True):
            slope = slope + hy.diff(rate, variable) * other
        rows.append((tangent, slope))
    return [*system, *rows]


def follow(system, start, pars, ts, prec):
    def number(x):
        return hy.real(float(x), prec)

    zeros = [0.0] * (len(system) - len(start))
    ta = hy.taylor_adaptive(
        system,
        [number(x) for x in [*start, *zeros]],
        pars=[number(p) for p in pars],
        fp_type=hy.real,
        prec=prec,
        compact_mode=True,
    )
    rows = []
    for t in ts:
        ta.propagate_until(number(t))
        rows.append(list(ta.state))
    return rows


def agreed(system, start, pars, ts):
    """Rows of doubles, and how far the two precisions are apart."""
    low, high = (follow(system, start, pars, ts, prec) for prec in PRECISIONS)
    pairs = [(a, b) for x, y in zip(low, high, strict=True) for a, b in zip(x, y, strict=True)]
    gap = max(abs(float(b - hy.real(a, PRECISIONS[1]))) for a, b in pairs)
    if gap > AGREE:
        raise RuntimeError(f"the two precisions differ by {gap:.1e}")
    states = [[float(x) for x in row] for row in high]
    return {"start": start, "pars": pars, "ts": ts, "states": states, "precisions_agree_to": gap}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--output", default="long_spans_reference.json")
    args = parser.parse_args()
    found = {f"henon {key}": agreed(henon(), y0, [], ts) for key, (y0, ts) in HENON.items()}
    found["lorenz"] = agreed(with_derivative(lorenz()), *LORENZ)
    found["eight"] = agreed(with_derivative(eight()), *EIGHT)
    with open(args.output, "w") as file:
        json.dump(found, file, indent=0)


if __name__ == "__main__":
    main()
