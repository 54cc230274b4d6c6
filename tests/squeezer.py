"""Andrews' squeezer: seven rigid bodies in a plane, six constraints, a motor and a stiff spring.

Problem: Hairer, Wanner (1996), Solving Ordinary Differential Equations II, section VII.7, and the
test set of Bari; state [beta, theta, gamma, phi, delta, omega, epsilon, their rates], angles [rad]
from a start at rest to 0.03 s. The accelerations solve M a = f + G^T l, G a = -h.

The end below is by extrapolation in 80-bit floats, `extrapolated(150)` and `(200)`, which agree to
1e-15 of the largest entry. The end printed with the problem differs from it by 9e-11, as it
would at a time later by 1.0e-12 s.
"""

import jax.numpy as jnp
import numpy as np

import jaxdyn

T1 = 0.03
START = np.array(
    [
        -0.0617138900142764496358948458001,
        0.0,
        0.455279819163070380255912382449,
        0.222668390165885884674473185609,
        0.487364979543842550225598953530,
        -0.222668390165885884674473185609,
        1.23054744454982119249735015568,
        *7 * [0.0],
    ]
)
PRINTED = (15.81077119629904, -15.75637105984298, 0.04082224013073101)
END = np.array(
    [
        15.810771195153709,
        -15.75637105841184,
        0.04082224011964531,
        -0.5347301163420803,
        0.5244099658799543,
        0.5347301163420806,
        1.0480807410419368,
        1139.9203022591062,
        -1424.3792951775404,
        11.032911910618779,
        19.29337410503235,
        0.5735699148295006,
        -19.29337410503232,
        0.323179149249135,
    ]
)
M1, M2, M3, M4, M5, M6, M7 = 0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498
I1, I2, I3, I4, I5, I6, I7 = 2.194e-6, 4.41e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5
XA, YA, XB, YB, XC, YC, C0, L0 = (
    -0.06934,
    -0.00227,
    -0.03635,
    0.03273,
    0.014,
    0.072,
    4530.0,
    0.07785,
)
D, DA, E, EA, RR, RA, SS, SA, SB = (
    0.028,
    0.0115,
    0.02,
    0.01421,
    0.007,
    0.00092,
    0.035,
    0.01874,
    0.01043,
)
SC, SD, TA, TB, U, UA, UB, ZF, ZT, FA = (
    *(0.018, 0.02, 0.02308, 0.00916, 0.04, 0.01228, 0.00449, 0.02, 0.04, 0.01421),
)
MOTOR = 0.033


def matrix(xp, y):
    """The 13 x 13 matrix [[M, G^T], [G, 0]] and the right-hand side [f, -h]."""
    be, th, ga, ph, de, om, ep = (y[i] for i in range(7))
    dbe, dth, dga, dph, dde, dom, dep = (y[i] for i in range(7, 14))
    sin, cos = xp.sin, xp.cos
    k = [[0.0 * be] * 13 for _ in range(13)]
    k[0][0] = M1 * RA**2 + M2 * (RR**2 - 2 * DA * RR * cos(th) + DA**2) + I1 + I2
    k[0][1] = k[1][0] = M2 * (DA**2 - DA * RR * cos(th)) + I2
    k[1][1] += M2 * DA**2 + I2
    k[2][2] += M3 * (SA**2 + SB**2) + I3
    k[3][3] += M4 * (E - EA) ** 2 + I4
    k[3][4] = k[4][3] = M4 * ((E - EA) ** 2 + ZT * (E - EA) * sin(ph)) + I4
    arm = ZT**2 + 2 * ZT * (E - EA) * sin(ph) + (E - EA) ** 2
    k[4][4] = M4 * arm + M5 * (TA**2 + TB**2) + I4 + I5
    k[5][5] += M6 * (ZF - FA) ** 2 + I6
    k[5][6] = k[6][5] = M6 * ((ZF - FA) ** 2 - U * (ZF - FA) * sin(om)) + I6
    arm = (ZF - FA) ** 2 - 2 * U * (ZF - FA) * sin(om) + U**2
    k[6][6] = M6 * arm + M7 * (UA**2 + UB**2) + I6 + I7
    x = SD * cos(ga) + SC * sin(ga) + XB - XC
    z = SD * sin(ga) - SC * cos(ga) + YB - YC
    length = xp.sqrt(x * x + z * z)
    pull = -C0 * (length - L0) / length
    turned = x * (SC * cos(ga) - SD * sin(ga)) + z * (SD * cos(ga) + SC * sin(ga))
    b = [
        MOTOR - M2 * DA * RR * dth * (dth + 2 * dbe) * sin(th),
        M2 * DA * RR * dbe**2 * sin(th),
        pull * turned,
        M4 * ZT * (E - EA) * dde**2 * cos(ph),
        -M4 * ZT * (E - EA) * dph * (dph + 2 * dde) * cos(ph),
        -M6 * U * (ZF - FA) * dep**2 * cos(om),
        M6 * U * (ZF - FA) * dom * (dom + 2 * dep) * cos(om),
    ]
    bt, pd, oe = be + th, ph + de, om + ep
    rows = [[0.0 * be] * 7 for _ in range(6)]
    for i in (0, 2, 4):
        rows[i][:2] = [-RR * sin(be) + D * sin(bt), D * sin(bt)]
        rows[i + 1][:2] = [RR * cos(be) - D * cos(bt), -D * cos(bt)]
    rows[0][2], rows[1][2] = -SS * cos(ga), -SS * sin(ga)
    rows[2][3:5] = [-E * cos(pd), -E * cos(pd) + ZT * sin(de)]
    rows[3][3:5] = [-E * sin(pd), -E * sin(pd) - ZT * cos(de)]
    rows[4][5:] = [ZF * sin(oe), ZF * sin(oe) - U * cos(ep)]
    rows[5][5:] = [-ZF * cos(oe), -ZF * cos(oe) - U * sin(ep)]
    for i, row in enumerate(rows):
        k[7 + i][:7] = row
        for j, entry in enumerate(row):
            k[j][7 + i] = entry
    bx = RR * cos(be) * dbe**2 - D * cos(bt) * (dbe + dth) ** 2
    by = RR * sin(be) * dbe**2 - D * sin(bt) * (dbe + dth) ** 2
    b += [
        bx - SS * sin(ga) * dga**2,
        by + SS * cos(ga) * dga**2,
        bx - E * sin(pd) * (dph + dde) ** 2 - ZT * cos(de) * dde**2,
        by + E * cos(pd) * (dph + dde) ** 2 - ZT * sin(de) * dde**2,
        bx - ZF * cos(oe) * (dom + dep) ** 2 - U * sin(ep) * dep**2,
        by - ZF * sin(oe) * (dom + dep) ** 2 + U * cos(ep) * dep**2,
    ]
    return xp.stack([xp.stack(row) for row in k]), xp.stack(b)


def rate(t, y):
    """The mechanism as an ordinary differential equation, without projection."""
    return jnp.concatenate([y[7:], jnp.linalg.solve(*matrix(jnp, y))[:7]])


def scene() -> jaxdyn.Scene:
    """The squeezer at its start."""
    angles = ("beta", "theta", "gamma", "phi", "delta", "omega", "epsilon")
    names = [*((name, "rad") for name in angles), *((f"{name}_dot", "rad/s") for name in angles)]
    return jaxdyn.ode(rate, START, T1, names=names)


def _rate(y):
    a, b = matrix(np, y)
    rows = np.concatenate([a, b[:, None]], axis=1)
    for n in range(13):
        pivot = n + np.argmax(np.abs(rows[n:, n]))
        rows[[n, pivot]] = rows[[pivot, n]]
        rows[n] /= rows[n, n]
        others = rows[:, n].copy()
        others[n] = 0
        rows -= others[:, None] * rows[n]
    return np.concatenate([y[7:], rows[:7, -1]])


def extrapolated(steps: int, order: int = 20) -> np.ndarray:
    """(14,) the state at T1 by Gragg's extrapolated midpoint rule in 80-bit floats."""
    y, h = START.astype(np.longdouble), np.longdouble(T1) / steps
    for _ in range(steps):
        table: list[list] = []
        for j in range(1, order // 2 + 1):
            before, now, part = y, y + h / (2 * j) * _rate(y), h / (2 * j)
            for _ in range(2 * j - 1):
                before, now = now, before + 2 * part * _rate(now)
            row = [(before + now + part * _rate(now)) / 2]
            for m in range(1, j):
                ratio = (np.longdouble(j) / (j - m)) ** 2
                row.append(row[-1] + (row[-1] - table[-1][m - 1]) / (ratio - 1))
            table.append(row)
        y = table[-1][-1]
    return y
