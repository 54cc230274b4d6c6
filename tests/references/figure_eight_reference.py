"""High-precision reference numbers for the figure eight and its weakly unstable neighbour.

Problem: three equal masses m = 1 in the plane, Newtonian gravity with G = 1.  A state is
    x1 y1 x2 y2 x3 y3 vx1 vy1 vx2 vy2 vx3 vy3.
The script is self-contained: it uses nothing of the package whose tests its numbers serve.

What it computes
----------------
``figure_eight`` (Moore 1993; Chenciner and Montgomery 2000) and ``neighbour`` (Simo's second
eight, "S8" of Suvakov and Dmitrasinovic, Am. J. Phys. 82 (2014) 609: not a choreography,
weakly unstable) share this normal form.  At t = 0 the bodies are in
line, body 3 at the origin, x1 = -x2 with |x1| = 1, v1 = v2 = -v3/2; at t = T/4 they form an
isosceles triangle whose apex is body 3, on the x axis.  Both have angular momentum exactly 0.
Three unknowns (vx1, vy1, T, in the frame where x1 = (-1, 0)) meet three conditions at T/4, so
Newton's method with the variational equations is square and regular; a last rotation puts the
apex on the x axis.  From the monodromy matrix M over one T come the multipliers.  In the plane
8 of the 12 are 1; with t = z + 1/z for each of the two other pairs,
    t1 + t2 = tr M - 8,    t1^2 + t2^2 = tr M^2 - 4.
|t| < 2 gives z = exp(+-2 pi i nu), and |t| > 2 a real pair z, 1/z.

``neighbour_from_course``: the same neighbour as plain closing y(T) = y0 finds it from the rough
guess COURSE: damped minimum-norm Newton (12 residuals, 13 unknowns y0 and T, the 8 largest
singular values kept) in double precision, then full steps in extended precision.  The other
five directions (two shifts, a turn, the phase, the scale) are free, so the digits of this y0
belong to this path; what does not depend on it is T|E|^(3/2), L|E|^(1/2) and the multipliers.

``full_step_orbit``: a different orbit, to which undamped Newton from the same guess happens to
lead after some wandering.  It is no neighbour of the eight; it is listed as a warning.

How it is checked
-----------------
1. All of it is done at two precisions with heyoka's MPFR integrator.
2. Closing, (for the eight) the choreography property, energy, the multipliers and the
   symplectic identity are found again by a Taylor integrator written here in mpmath.

Run:  python figure_eight_reference.py [--output FILE] [--digits N] [--no-mpmath-check] [--census]
The numbers kept were made with --census; it all takes about six minutes on one core.
It needs mpmath, numpy and heyoka (built with MPFR).  Numbers are written as decimal strings.
"""

import argparse
import json
import time

import mpmath as mp
import numpy as np

PAIRS = ((0, 1), (0, 2), (1, 2))
COURSE = (
    [
        *[-0.755, 0.355, 1.155, -0.0755, -0.4055, -0.3055],
        *[0.9955, 0.07855, 0.1055, 0.4755, -1.1055, -0.5355],
    ],
    8.0,
)
# (vx1, vy1, T) with the bodies at (-1, 0), (1, 0), (0, 0): rough values to start from
ROUGH_EIGHT = ("0.347116", "0.532725", "6.32591")
ROUGH_NEIGHBOUR = ("0.339393", "0.536191", "6.29168")
# where undamped Newton from COURSE ends (double precision)
ROUGH_FULL_STEP = (
    [
        *[1.8849349147430, -0.5560058841311, 0.1284498258707, -0.0543962402977],
        *[-1.9444823064353, 0.5185305343967, 0.2845448516342, -0.0196950815987],
        *[-0.3600062649886, 0.0984419950818, 0.0754614133543, -0.0787469134830],
    ],
    8.1078820562143,
)


# ------------------------------------------------------------------ integrator 1: heyoka
class HeyokaFlow:
    """Flow and its Jacobian; digits=None is double precision, else MPFR with that many."""

    def __init__(self, digits=None):
        # Here, so that collecting the tests, which need only the numbers, needs no heyoka.
        import heyoka as hy

        self.real = hy.real
        names = "x1 y1 x2 y2 x3 y3 u1 v1 u2 v2 u3 v3".split()
        var = hy.make_vars(*names)
        pos, vel = var[:6], var[6:]
        terms = [[] for _ in range(6)]
        for i, j in PAIRS:
            d = [pos[2 * j + k] - pos[2 * i + k] for k in (0, 1)]
            cube = hy.sum([d[0] * d[0], d[1] * d[1]])
            cube = cube * hy.sqrt(cube)
            for k in (0, 1):
                terms[2 * i + k].append(d[k] / cube)
                terms[2 * j + k].append(-d[k] / cube)
        eqs = [*zip(pos, vel, strict=True)]
        eqs += [(v, hy.sum(t)) for v, t in zip(vel, terms, strict=True)]
        system = hy.var_ode_sys(eqs, hy.var_args.vars, order=1)
        self.digits = digits
        if digits is None:
            self.number = float
            start = [float(k) for k in range(12)]
            self.integrator = hy.taylor_adaptive(system, start, tol=1e-16, compact_mode=True)
        else:
            self.prec = int(digits * 3.3219281) + 8
            self.number = lambda s: hy.real(mp.nstr(mp.mpf(s), digits + 5), self.prec)
            start = [self.number(k) for k in range(12)]
            self.integrator = hy.taylor_adaptive(
                system, start, fp_type=hy.real, prec=self.prec, compact_mode=True
            )

    def __call__(self, y0, t):
        """State after time t (list of 12) and the 12 by 12 Jacobian (list of rows)."""
        unit = [float(i == j) for i in range(12) for j in range(12)]
        values = [self.number(v) for v in list(y0) + unit]
        ta = self.integrator
        ta.time = self.number(0)
        ta.state[:] = np.array(values, dtype=float if self.digits is None else self.real)
        ta.propagate_until(self.number(t))
        if self.digits is None:
            out = [float(v) for v in ta.state]
        else:
            out = [mp.mpf(str(v)) for v in ta.state]
        return out[:12], [out[12 + 12 * i : 24 + 12 * i] for i in range(12)]


# ------------------------------------------------------------------ integrator 2: mpmath
def _conv(a, b, n):
    """Coefficient n of the product of the series a and b."""
    return mp.fdot(a[: n + 1], b[n::-1])


def _power_next(u, s, p, n):
    """Coefficient n of u = s^p, from coefficients 0..n-1 of u and 0..n of s."""
    return mp.fdot([(p * (n - k) - k) * s[n - k] for k in range(n)], u[:n]) / (n * s[0])


def mpmath_flow(y0, t_end):
    """State and Jacobian by a Taylor method of variable step, at mpmath's precision."""
    order = int(-mp.log(mp.eps) / 2) + 4
    p3, p5 = mp.mpf(-3) / 2, mp.mpf(-5) / 2
    # column 0 is the orbit, columns 1 to 12 are the tangent vectors
    cols = [list(y0)] + [[mp.mpf(i == j) for i in range(12)] for j in range(12)]
    t = mp.mpf(0)
    steps = 0
    while t < t_end:
        ser = [[[v] for v in c] for c in cols]
        diff = [[[[], []] for _ in PAIRS] for _ in cols]  # differences of positions
        s = [[] for _ in PAIRS]  # squared distance
        u3 = [[] for _ in PAIRS]  # distance^-3
        u5 = [[] for _ in PAIRS]  # distance^-5
        half_ds = [[[] for _ in PAIRS] for _ in cols]  # half the tangent of s
        du3 = [[[] for _ in PAIRS] for _ in cols]  # tangent of u3
        for n in range(order):
            for c, col in enumerate(ser):
                acc = [mp.mpf(0)] * 6
                for q, (i, j) in enumerate(PAIRS):
                    for k in (0, 1):
                        diff[c][q][k].append(col[2 * j + k][n] - col[2 * i + k][n])
                    base = diff[0][q]
                    if c == 0:
                        s[q].append(_conv(base[0], base[0], n) + _conv(base[1], base[1], n))
                        if n == 0:
                            u3[q].append(s[q][0] ** p3)
                            u5[q].append(s[q][0] ** p5)
                        else:
                            u3[q].append(_power_next(u3[q], s[q], p3, n))
                            u5[q].append(_power_next(u5[q], s[q], p5, n))
                        force = [_conv(base[k], u3[q], n) for k in (0, 1)]
                    else:
                        tan = diff[c][q]
                        half_ds[c][q].append(_conv(base[0], tan[0], n) + _conv(base[1], tan[1], n))
                        du3[c][q].append(-3 * _conv(u5[q], half_ds[c][q], n))
                        force = [
                            _conv(tan[k], u3[q], n) + _conv(base[k], du3[c][q], n) for k in (0, 1)
                        ]
                    for k in (0, 1):
                        acc[2 * i + k] += force[k]
                        acc[2 * j + k] -= force[k]
                for k in range(6):
                    col[k].append(col[6 + k][n] / (n + 1))
                    col[6 + k].append(acc[k] / (n + 1))
        # step: last two orders of the orbit and of its tangents (Jorba and Zou 2005)
        h = t_end - t
        for col in ser:
            scale = max(abs(x[0]) for x in col)
            for n in (order - 1, order):
                top = max(abs(x[n]) for x in col)
                if top:
                    h = min(h, (scale / top) ** (mp.mpf(1) / n) * mp.exp(-2))
        cols = [[mp.polyval(x[::-1], h) for x in col] for col in ser]
        t += h
        steps += 1
    return cols[0], [[cols[1 + j][i] for j in range(12)] for i in range(12)]


# ------------------------------------------------------------------ mechanics
def _vec(y, i):
    return y[2 * i], y[2 * i + 1]


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1]


def _cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def _sub(a, b):
    return a[0] - b[0], a[1] - b[1]


def energy(y):
    kinetic = sum(v * v for v in y[6:]) / 2
    for i, j in PAIRS:
        d = _sub(_vec(y, i), _vec(y, j))
        kinetic -= _dot(d, d) ** (-mp.mpf(1) / 2)
    return kinetic


def angular_momentum(y):
    return sum(_cross(_vec(y, i), _vec(y, 3 + i)) for i in range(3))


def rhs(y):
    acc = [0 * y[0]] * 6
    for i, j in PAIRS:
        d = _sub(_vec(y, j), _vec(y, i))
        r2 = _dot(d, d)
        w = 1 / (r2 * (r2 ** (mp.mpf(1) / 2)))
        for k in (0, 1):
            acc[2 * i + k] += d[k] * w
            acc[2 * j + k] -= d[k] * w
    return list(y[6:]) + acc


def multipliers(jac):
    """The traces t = z + 1/z of the two non-trivial pairs, nearest to 2 first, and checks."""
    m = mp.matrix(jac)
    m2 = m * m
    tr1, tr2, tr3 = (sum(a[i, i] for i in range(12)) for a in (m, m2, m2 * m))
    total, squares = tr1 - 8, tr2 - 4
    root = mp.sqrt(2 * squares - total**2)
    t1, t2 = (total + root) / 2, (total - root) / 2
    # tr M^3 holds z^3 + z^-3 = t^3 - 3 t; M is symplectic
    cubic = abs(tr3 - 8 - (t1**3 - 3 * t1) - (t2**3 - 3 * t2))
    j = mp.zeros(12)
    for i in range(6):
        j[i, 6 + i], j[6 + i, i] = 1, -1
    checks = {"trace_of_cube": cubic, "symplectic": mp.mnorm(m.T * j * m - j, mp.inf)}
    return (t1, t2), checks


def describe_pair(t):
    out = {"trace": t}
    if abs(t) < 2:
        out["kind"] = "unit circle"
        out["nu"] = mp.acos(t / 2) / (2 * mp.pi)
    else:
        out["kind"] = "real"
        big = (abs(t) + mp.sqrt(t * t - 4)) / 2
        out["lambda"] = mp.sign(t) * big
        out["one_over_lambda"] = mp.sign(t) / big
        out["log_abs_lambda"] = mp.log(big)
    return out


# ------------------------------------------------------------------ Newton's methods
def _residual_row(r: list, d: list) -> list:
    """Change of the three conditions under the change d of the state at T/4."""
    e = [_vec(d, i) for i in range(6)]
    r12, e12 = _sub(r[0], r[1]), _sub(e[0], e[1])
    v12, f12 = _sub(r[3], r[4]), _sub(e[3], e[4])
    return [
        _dot(e[2], r12) + _dot(r[2], e12),
        _dot(e[2], r[5]) + _dot(r[2], e[5]),
        _cross(e[2], v12) + _cross(r[2], f12),
    ]


def symmetric_newton(flow, rough, digits):
    """Normal form (see the module's docstring): returns y0 and T."""
    vx, vy, period = (mp.mpf(v) for v in rough)
    zero, one = mp.mpf(0), mp.mpf(1)
    size = mp.inf
    for _ in range(30):
        y0 = [-one, zero, one, zero, zero, zero, vx, vy, vx, vy, -2 * vx, -2 * vy]
        y, jac = flow(y0, period / 4)
        r = [_vec(y, i) for i in range(6)]
        if size < mp.mpf(10) ** (3 - digits):
            break

        # symmetric triangle; apex moving across the axis; base moving along it, mirrored
        res = [
            _dot(r[2], _sub(r[0], r[1])),
            _dot(r[2], r[5]),
            _cross(r[2], _sub(r[3], r[4])),
        ]
        d_vx = [row[6] + row[8] - 2 * row[10] for row in jac]
        d_vy = [row[7] + row[9] - 2 * row[11] for row in jac]
        d_t = [v / 4 for v in rhs(y)]
        a = mp.matrix([_residual_row(r, d) for d in (d_vx, d_vy, d_t)]).T
        step = mp.lu_solve(a, -mp.matrix(res))
        vx, vy, period = vx + step[0], vy + step[1], period + step[2]
        size = max(abs(v) for v in step)
    else:
        raise RuntimeError("the symmetric Newton did not settle")
    # turn the apex of the triangle at T/4 to the x axis, body 1 to the side x < 0
    norm = mp.sqrt(_dot(r[2], r[2]))
    c, s = r[2][0] / norm, -r[2][1] / norm
    if c < 0:
        c, s = -c, -s
    turned = []
    for i in range(6):
        x, y = _vec(y0, i)
        turned += [c * x - s * y, s * x + c * y]
    return turned, period


def closing_newton_double(flow, y0, period, rank=8, most=60):
    """Damped minimum-norm Newton on y(T) - y0 in double precision."""
    y0 = np.array(y0)
    yt, jac = flow(y0, period)
    res = np.array(yt) - y0
    for _ in range(most):
        a = np.column_stack([np.array(jac) - np.eye(12), np.array(rhs(yt), dtype=float)])
        u, sv, vt = np.linalg.svd(a)
        step = -vt[:rank].T @ ((u[:, :rank].T @ res) / sv[:rank])
        size, share = np.linalg.norm(res), 1.0
        while share > 1e-4:
            y_new, t_new = y0 + share * step[:12], period + share * step[12]
            yt, jac = flow(y_new, t_new)
            res_new = np.array(yt) - y_new
            if np.linalg.norm(res_new) < size * (1 - 1e-4 * share):
                break
            share /= 2
        else:
            raise RuntimeError("the damped Newton is stuck")
        y0, period, res = y_new, t_new, res_new
        if np.linalg.norm(res) < 1e-11:
            return list(y0), period
    raise RuntimeError("the damped Newton did not settle")


def closing_newton_extended(flow, y0, period, digits, rank=8):
    """Full minimum-norm Newton steps on y(T) - y0 at mpmath's precision."""
    y0, period = [mp.mpf(v) for v in y0], mp.mpf(period)
    for _ in range(12):
        yt, jac = flow(y0, period)
        res = mp.matrix([a - b for a, b in zip(yt, y0, strict=True)])
        if mp.norm(res, mp.inf) < mp.mpf(10) ** (6 - digits):
            return y0, period
        f = rhs(yt)
        a = mp.zeros(12, 13)
        for i in range(12):
            for k in range(12):
                a[i, k] = jac[i][k] - (i == k)
            a[i, 12] = f[i]
        u, sv, vt = mp.svd_r(a)
        step = mp.zeros(13, 1)
        for k in range(rank):
            weight = sum(u[i, k] * res[i] for i in range(12)) / sv[k]
            for i in range(13):
                step[i] -= weight * vt[k, i]
        y0 = [v + step[i] for i, v in enumerate(y0)]
        period += step[12]
    raise RuntimeError("the extended Newton did not settle")


# ------------------------------------------------------------------ reports
def next_body(y):
    """Each body takes the place of the next one: the label shift 1 <- 2 <- 3 <- 1."""
    return y[2:6] + y[0:2] + y[8:12] + y[6:8]


def gap(a, b):
    return max(abs(p - q) for p, q in zip(a, b, strict=True))


def report(flow, y0, period):
    """All numbers of one orbit as mpmath values, strings and nested dicts."""
    yt, jac = flow(y0, period)
    third, _ = flow(y0, period / 3)
    traces, checks = multipliers(jac)
    e = energy(y0)
    ang = angular_momentum(y0)
    return {
        "y0": list(y0),
        "period": period,
        "energy": e,
        "angular_momentum": ang,
        "scale_free_period": period * abs(e) ** (mp.mpf(3) / 2),
        "scale_free_angular_momentum": ang * mp.sqrt(abs(e)),
        "pairs": [describe_pair(t) for t in traces],
        "residuals": {
            "closing": gap(yt, y0),
            "shifted_after_third_forward": gap(third, next_body(y0)),
            "shifted_after_third_backward": gap(third, next_body(next_body(y0))),
            "energy_drift": abs(energy(yt) - e),
            **checks,
        },
    }


def compute(digits):
    """Every orbit at one working precision."""
    mp.mp.dps = digits + 10
    flow = HeyokaFlow(digits)
    double = HeyokaFlow()
    orbits = {
        "figure_eight": symmetric_newton(flow, ROUGH_EIGHT, digits),
        "neighbour": symmetric_newton(flow, ROUGH_NEIGHBOUR, digits),
        "neighbour_from_course": closing_newton_extended(
            flow, *closing_newton_double(double, *COURSE), digits
        ),
        "full_step_orbit": closing_newton_extended(flow, *ROUGH_FULL_STEP, digits),
    }
    return {name: report(flow, *orbit) for name, orbit in orbits.items()}


def invariants(rep):
    out = [rep["period"], rep["energy"], rep["scale_free_period"]]
    return out + [p["trace"] for p in rep["pairs"]]


def to_text(x, digits):
    if isinstance(x, dict):
        return {k: to_text(v, 3 if k in ("residuals", "checks") else digits) for k, v in x.items()}
    if isinstance(x, (list, tuple)):
        return [to_text(v, digits) for v in x]
    if isinstance(x, mp.mpf):
        return mp.nstr(x, digits, strip_zeros=False)
    return x


def double_error(flow, y0, period):
    """Closing residual of the data rounded to double (exact flow of the rounded data)."""
    y0 = [mp.mpf(float(v)) for v in y0]
    yt, _ = flow(y0, mp.mpf(float(period)))
    return gap(yt, y0)


def census(flow, eight_orbit):
    """Where the damped double-precision Newton goes from many starts (counts by T|E|^(3/2))."""
    rng = np.random.default_rng(1)
    course, eight = np.array(COURSE[0]), np.array([float(v) for v in eight_orbit[0]])
    starts = {
        "course, T = 7.4 (0.1) 8.2": [(course, 7.4 + 0.1 * k) for k in range(9)],
        "course + normal noise 0.02, T = 8": [
            (course + 0.02 * rng.standard_normal(12), 8.0) for _ in range(20)
        ],
        "eight + normal noise 0.02, T = 6.326": [
            (eight + 0.02 * rng.standard_normal(12), 6.326) for _ in range(20)
        ],
    }
    out = {}
    for label, group in starts.items():
        counts = {}
        for y0, period in group:
            try:
                y, t = closing_newton_double(flow, y0, period, most=40)
                key = f"{float(t * abs(energy(y)) ** 1.5):.8f}"
            except RuntimeError:
                key = "none in 40 steps"
            counts[key] = counts.get(key, 0) + 1
        out[label] = counts
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", default="figure_eight_reference.json")
    parser.add_argument("--digits", type=int, default=44, help="working digits, 40 or more")
    parser.add_argument("--no-mpmath-check", action="store_true")
    parser.add_argument("--census", action="store_true", help="try Newton from many starts")
    args = parser.parse_args()
    clock = time.time()

    def say(text):
        print(f"[{time.time() - clock:6.1f} s] {text}", flush=True)

    low = compute(args.digits - 12)
    say(f"heyoka MPFR at {args.digits - 12} digits done")
    high = compute(args.digits)
    say(f"heyoka MPFR at {args.digits} digits done")
    flow = HeyokaFlow(args.digits)
    kept = args.digits - 14
    result = {
        "problem": "equal masses 1, G = 1, plane; "
        "state order x1 y1 x2 y2 x3 y3 vx1 vy1 vx2 vy2 vx3 vy3",
        "working_digits": args.digits,
        "digits_written": kept,
        "orbits": {},
    }
    for name, rep in high.items():
        checks = {}
        # the path's own frame is free along five symmetries, so there compare only invariants
        start = 2 if name in ("neighbour_from_course", "full_step_orbit") else 0
        pairs = list(zip(invariants(low[name]), invariants(rep), strict=True))[start:]
        checks["two_precisions"] = max(abs(a - b) for a, b in pairs)
        if start == 0:
            checks["two_precisions_y0"] = gap(low[name]["y0"], rep["y0"])
        if not args.no_mpmath_check and name in ("figure_eight", "neighbour"):
            with mp.workdps(40):
                y0, period = [+v for v in rep["y0"]], +rep["period"]
                other = report(mpmath_flow, y0, period)
            checks["mpmath_invariants"] = max(
                abs(a - b) for a, b in zip(invariants(other), invariants(rep), strict=True)
            )
            checks["mpmath_residuals"] = other["residuals"]
            say(f"mpmath check of {name} done")
        rep["checks"] = checks
        text = to_text(rep, kept)
        text["double"] = {
            "y0": [repr(float(v)) for v in rep["y0"]],
            "period": repr(float(rep["period"])),
            "energy": repr(float(rep["energy"])),
            "scale_free_period": repr(float(rep["scale_free_period"])),
            "closing_of_rounded_data": mp.nstr(double_error(flow, rep["y0"], rep["period"]), 3),
        }
        result["orbits"][name] = text
    same = gap(invariants(high["neighbour"])[2:], invariants(high["neighbour_from_course"])[2:])
    result["neighbour_minus_neighbour_from_course_invariants"] = mp.nstr(same, 3)
    if args.census:
        eight = high["figure_eight"]
        result["census"] = census(HeyokaFlow(), (eight["y0"], eight["period"]))
        say("census done")
    with open(args.output, "w", encoding="utf-8") as handle:
        json.dump(result, handle, indent=2)
        handle.write("\n")
    print(json.dumps(result, indent=2))
    say(f"written {args.output}")


if __name__ == "__main__":
    main()
