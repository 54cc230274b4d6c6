"""High-precision reference numbers for the Pythagorean problem of three bodies.

Problem (Burrau 1913; Szebehely and Peters, Astron. J. 72 (1967) 876): masses 3, 4 and 5 at rest
at (1, 3), (-2, -1) and (1, -1), G = 1, followed to t = 70. The script is self-contained: it uses
nothing of the package whose tests its numbers serve.

What it computes, by heyoka's MPFR Taylor integrator in the plain cartesian equations: the state
at t = 70; every closest approach (event r . v = 0, rising) nearer than 0.05; the orbit of the
final binary (bodies 2 and 3: semi-major axis, eccentricity) and the escape of body 1 (speed at
infinity relative to the binary, and its direction).

How it is checked: at two precisions, which must agree to AGREE digits; some 12 digits are lost
to the encounters.

Run:  python pythagorean_reference.py [--output FILE]
It needs heyoka (built with MPFR) and mpmath, and takes about two minutes on one core.
"""

import argparse
import json

import heyoka as hy
import mpmath as mp

MASSES = (3, 4, 5)
START = (1, 3, -2, -1, 1, -1) + (0,) * 6
T1 = 70
PAIRS = ((0, 1), (0, 2), (1, 2))
NEAR = 0.05
DIGITS = (36, 48)
AGREE = 20


def _number(value, prec):
    return hy.real(mp.nstr(mp.mpf(value), mp.mp.dps), prec)


def integrate(digits):
    """State (12) at T1 and the approaches (t, i, j, distance) on the way."""
    prec = int(digits * 3.3219281) + 8
    var = hy.make_vars(*"x1 y1 x2 y2 x3 y3 u1 v1 u2 v2 u3 v3".split())
    pos, vel = var[:6], var[6:]
    terms = [[] for _ in range(6)]
    near, events = [], []
    for i, j in PAIRS:
        d = [pos[2 * j + k] - pos[2 * i + k] for k in (0, 1)]
        w = [vel[2 * j + k] - vel[2 * i + k] for k in (0, 1)]
        square = hy.sum([d[0] * d[0], d[1] * d[1]])
        cube = square * hy.sqrt(square)
        for k in (0, 1):
            terms[2 * i + k].append(float(MASSES[j]) * d[k] / cube)
            terms[2 * j + k].append(-float(MASSES[i]) * d[k] / cube)

        def seen(ta, t, _sign, i=i, j=j):
            ta.update_d_output(t)
            r = [mp.mpf(str(v)) for v in ta.d_output]
            distance = mp.hypot(r[2 * j] - r[2 * i], r[2 * j + 1] - r[2 * i + 1])
            if distance < NEAR:
                near.append((mp.mpf(str(t)), i, j, distance))

        rising = hy.event_direction.positive
        turn = d[0] * w[0] + d[1] * w[1]
        events.append(hy.nt_event(turn, seen, direction=rising, fp_type=hy.real))
    system = [*zip(pos, vel, strict=True)]
    system += [(v, hy.sum(t)) for v, t in zip(vel, terms, strict=True)]
    start = [_number(v, prec) for v in START]
    ta = hy.taylor_adaptive(system, start, fp_type=hy.real, prec=prec, nt_events=events)
    ta.propagate_until(_number(T1, prec))
    return [mp.mpf(str(v)) for v in ta.state], near


def outcome(y):
    """Elements of the binary of bodies 2 and 3, and of the escape of body 1 from it."""

    def relative(a, b):
        """Position and velocity from the centre of mass of the bodies in a to that of b."""

        def centre(bodies, at):
            total = sum(MASSES[i] for i in bodies)
            return [sum(MASSES[i] * y[at + 2 * i + k] for i in bodies) / total for k in (0, 1)]

        return [[q - p for p, q in zip(centre(a, at), centre(b, at), strict=True)] for at in (0, 6)]

    def elements(r, v, mu):
        distance = mp.hypot(*r)
        energy = (v[0] ** 2 + v[1] ** 2) / 2 - mu / distance
        turning = r[0] * v[1] - r[1] * v[0]
        return energy, mp.sqrt(1 + 2 * energy * turning**2 / mu**2)

    inner, e = elements(*relative((1,), (2,)), mp.mpf(9))
    r, v = relative((1, 2), (0,))
    outer, _ = elements(r, v, mp.mpf(12))
    return {
        "binary_semi_major_axis": -mp.mpf(9) / (2 * inner),
        "binary_eccentricity": e,
        "escape_speed": mp.sqrt(2 * outer),
        "escape_angle": mp.atan2(v[1], v[0]),
    }


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--output", default="pythagorean_reference.json")
    args = parser.parse_args()
    mp.mp.dps = DIGITS[1] + 5
    (low, _), (y, near) = (integrate(d) for d in DIGITS)
    gap = max(abs(a - b) for a, b in zip(low, y, strict=True))
    if gap > mp.mpf(10) ** -AGREE:
        raise RuntimeError(f"the two precisions differ by {mp.nstr(gap, 3)}")

    def text(x):
        return mp.nstr(x, AGREE)

    near.sort(key=lambda found: found[3])
    result = {
        "t1": T1,
        "precisions_agree_to": mp.nstr(gap, 3),
        "state": [text(v) for v in y],
        "outcome": {name: text(v) for name, v in outcome(y).items()},
        "closest_approaches": [
            {"t": text(t), "pair": [i, j], "distance": text(d)} for t, i, j, d in near[:10]
        ],
    }
    with open(args.output, "w") as file:
        json.dump(result, file, indent=1)


if __name__ == "__main__":
    main()
