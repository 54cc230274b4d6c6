"""How many published orbits can be proved to exist, which cannot, and why?

Run: ``python -m benchmarks.proofs [NAME...]``. It takes the 53 orbits of three equal masses in
``tests/published_three_body.csv`` (Li, Liao 2017), in the order of the steps that half a period
takes in doubles, finds each as one that retraces its path, and proves those whose largest
multiplier is below 1e4: half a period in ball arithmetic. Those that are proved are refined to 40
digits. Results are added one by one to ``proofs.json`` beside this file; rows that are already
there are not repeated, unless they are named.

The file has 21 rows, 20 of which are proved and refined to 40 digits; the others have not been run
yet. II.C^ic_190 has a multiplier of 2.5e4. A row takes half a minute to half an hour of processor
time: the longer ones do not contract at first, and take more digits of the derivatives. Multipliers
that are 1 are known by the energy, the angular momentum and the symplectic form of these
coordinates, which `prove` finds: I.A^ic_1 and I.A^ic_13 are proved stable, twelve others unstable.
Six rows were proved with 32 digits, before `prove` took more of them for multipliers: their boxes
are proved, their verdicts are not. With 32 digits the box of II.C^ic_18 did not contract.

The states are p = r_1 - r_2, q = r_3 and their rates, with the centre of mass at rest in the
origin: eight numbers instead of twelve, which halves the time. The orbits start at p = (-2, 0),
q = 0 with dp/dt = 0 and dq/dt = -2 (v1, v2).
"""

import csv
import json
import sys
import time
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

import jaxdyn
import orbits

TABLE = Path(__file__).parents[1] / "tests" / "published_three_body.csv"
STORED = Path(__file__).with_name("proofs.json")
#: Orbits with larger multipliers are not tried.
MOST = 1e4
#: Digits of the proofs: with 32, boxes are proved whose multipliers cannot be distinguished.
PROOF_DIGITS, DIGITS = 44, 40


def scene(a: float, b: float, period: float) -> jaxdyn.Scene:
    """The scene of a row."""
    start = [-2.0, 0.0, 0.0, 0.0, 0.0, 0.0, -2 * a, -2 * b]
    names = ["px", "py", "qx", "qy", "vpx", "vpy", "vqx", "vqy"]
    integrals = {"angular momentum": angular_momentum}
    return jaxdyn.ode(rate, start, period, names=names, energy=energy, integrals=integrals)


def rate(t, y):
    """(8,) of p, q and their rates."""
    p, q, vp, vq = jnp.split(y, 4)
    to_1, to_2, between = _pull((p - 3 * q) / 2), _pull(-(p + 3 * q) / 2), _pull(p)
    return jnp.concatenate([vp, vq, -2 * between - to_1 + to_2, to_1 + to_2])


def energy(t, y):
    """() kinetic and potential."""
    p, q, vp, vq = jnp.split(y, 4)
    sides = p, (p - 3 * q) / 2, (p + 3 * q) / 2
    kinetic = vp @ vp / 4 + 3 * (vq @ vq) / 4
    return kinetic - sum(1 / jnp.sqrt(side @ side) for side in sides)


def angular_momentum(t, y):
    """()."""
    p, q, vp, vq = jnp.split(y, 4)
    return (p[0] * vp[1] - p[1] * vp[0]) / 2 + 3 * (q[0] * vq[1] - q[1] * vq[0]) / 2


def _pull(side):
    """The attraction along a side."""
    squared = side @ side
    return side / (squared * jnp.sqrt(squared))


#: The time reversal that fixes the starts.
RETRACED = orbits.reversal(orbits.Symmetry(signs=(1, 1, -1, -1, -1, -1, 1, 1), reversing=True))


def run(names: list[str]) -> None:
    """Prove the orbits that are not stored yet, or the named ones, and store the results."""
    rows = list(csv.DictReader(TABLE.read_text().splitlines()))
    for row in sorted(rows, key=effort):
        stored = json.loads(STORED.read_text()) if STORED.is_file() else {}
        if row["name"] in names or (not names and row["name"] not in stored):
            stored[row["name"]] = outcome(row)
            STORED.write_text(json.dumps(stored, indent=1) + "\n")
            print(row["name"], stored[row["name"]], flush=True)


def effort(row: dict[str, str]) -> int:
    """Number of steps of SciPy's DOP853 over half a period."""
    a, b, period = (float(row[name]) for name in ("v1", "v2", "period"))

    def field(t, y):
        p, q, vp, vq = y.reshape(4, 2)
        sides = (p, (p - 3 * q) / 2, (-p - 3 * q) / 2)
        pull, to_1, to_2 = (side / np.hypot(*side) ** 3 for side in sides)
        return np.concatenate([vp, vq, -2 * pull - to_1 + to_2, to_1 + to_2])

    start = [-2.0, 0.0, 0.0, 0.0, 0.0, 0.0, -2 * a, -2 * b]
    found = solve_ivp(field, (0, period / 2), start, "DOP853", rtol=1e-7, atol=1e-9)
    return len(found.t)


def outcome(row: dict[str, str]) -> dict[str, Any]:
    """The result for a row of the table, with processor times."""
    start = time.process_time()
    a, b, period = (float(row[name]) for name in ("v1", "v2", "period"))
    orbit = orbits.find(scene(a, b, period), closing=RETRACED, rtol=1e-13, throw=False)
    if not orbit.ok:
        return {"found": False, "reason": orbit.message}
    largest = float(np.abs(orbits.stability(orbit).multipliers).max())
    result = {"found": True, "period": orbit.period, "largest multiplier": largest}
    if not largest < MOST:
        return result | {"proved": False, "reason": f"its largest multiplier is above {MOST:.0e}"}
    proof = orbits.prove(orbit, PROOF_DIGITS)
    result |= {
        "proved": proof.proved,
        "reason": proof.reason,
        "verdict": proof.verdict if proof.verdict_proved else "not proved",
        "radius": proof.radius,
        "bits": proof.bits,
        "proof seconds": round(time.process_time() - start, 1),
    }
    if proof.proved:
        start = time.process_time()
        refined = orbits.refine(orbit, DIGITS)
        result |= {"digits": refined.digits, "y0": refined.y0, "refined period": refined.period}
        result |= {"refinement seconds": round(time.process_time() - start, 1)}
    return result


if __name__ == "__main__":
    jaxdyn.configure()
    run(sys.argv[1:])
