"""Tolerances and small scenes that the tests share."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.extend.core import jaxprs_in_params

from jaxdyn import Scene
from jaxdyn.effects import CentralForce, PairGravity
from jaxdyn.files.digests import json_text
from jaxdyn.formulations.mechanism import Mechanism
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.solvers.formulas.formulas import Formulas, formulas

#: Where tests, stored references and published tables are.
TESTS = Path(__file__).parent
#: Scenes for questions that the course does not ask.
BEYOND = {*("henon_heiles", "hill", "n_body", "restricted_three_body")}
BEYOND |= {"restricted_three_body_in_space", "spring_chain", "linear_system"}
BEYOND |= {*("ball_on_table", "impact_oscillator", "rimless_wheel", "simplest_walker")}
#: Scenes of many kinds, quickly compiled: the default run takes them for all ready-made ones.
ZOO = ("cannonball", "cylinder_on_ramp", "feynman_plate", "hill", "lorenz", "n_body", "pendulum")
ZOO += ("satellite", "shaken_pendulum", "three_body")
#: Two formulas for one number: a few roundings apart, relative to numbers of order one.
EXACT = 1e-14
#: A solve at rtol 1e-13 or tighter over a span of order one: its steps' errors add up.
SOLVED = 1e-12
#: Fourth-order central differences at h = 1e-3: h^4/30 of a fifth derivative, or eps/h.
DIFFED = 1e-9

_H = 1e-3


def central_difference(fn, x):
    """Jacobian (..., k) of fn at x (k,) by differences that are right to order h^4."""
    columns = [
        (8 * (fn(x + _H * e) - fn(x - _H * e)) - (fn(x + 2 * _H * e) - fn(x - 2 * _H * e)))
        / (12 * _H)
        for e in jnp.eye(x.size)
    ]
    return jnp.stack(columns, axis=-1)


def gap(a, b) -> float:
    """Largest absolute difference; NaN, so no tolerance is met, where either is NaN."""
    a, b = np.asarray(a), np.asarray(b)
    assert a.shape == b.shape
    return float(np.max(np.abs(a - b)))


def refusal(call: Callable[[], object]) -> str:
    """What a call is refused with, in one line."""
    with pytest.raises(ValueError, match="expected") as refused:
        call()
    text = str(refused.value)
    assert "\n" not in text
    return text


def run_python(code: str, **env: str) -> str:
    """What a fresh Python prints; the given variables and a bare minimum are all it sees."""
    bare = {"PATH": "/usr/bin:/bin", "PYTHONPATH": ":".join(sys.path), "HOME": "/nonexistent"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=bare | env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def run_blocks(blocks: Iterable[str], folder: Path, *flags: str) -> str:
    """What Python blocks of a text print as one program, in a process and a folder of their own.

    It compiles as users' programs do, with XLA's optimisations.
    """
    done = subprocess.run(
        [sys.executable, *flags, "-c", "\n".join(blocks)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(TESTS.parent), "MPLBACKEND": "Agg", "XLA_FLAGS": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def forge(path: Path, record: dict) -> Path:
    """A file whose digest is right, whatever else is in it."""
    path.write_bytes(json_text({key: x for key, x in record.items() if key != "digest"}))
    return path


def kepler(e: float, angle: float = 0.0) -> Scene:
    """Two equal bodies on ellipses of eccentricity e from their nearest points.

    Relative motion with G (m1 + m2) = 1 and semi-major axis 1, so the period is 2 pi.
    """
    along = jnp.array([jnp.cos(angle), jnp.sin(angle)])
    across = jnp.array([-jnp.sin(angle), jnp.cos(angle)])
    r, v = (1 - e) * along, jnp.sqrt((1 + e) / (1 - e)) * across
    y0 = jnp.concatenate([-r, r, -v, v]) / 2
    return Scene(FreePoints([0.5, 0.5]), (PairGravity(1.0),), y0=y0, t1=2 * jnp.pi)


def kepler_state(e: float, t: float) -> np.ndarray:
    """(8,) state of `kepler(e)` at time t, from Kepler's equation E - e sin E = t."""
    anomaly = t
    for _ in range(50):
        anomaly -= (anomaly - e * np.sin(anomaly) - t) / (1 - e * np.cos(anomaly))
    b = np.sqrt(1 - e * e)
    r = np.array([np.cos(anomaly) - e, b * np.sin(anomaly)])
    v = np.array([-np.sin(anomaly), b * np.cos(anomaly)]) / (1 - e * np.cos(anomaly))
    return np.concatenate([-r, r, -v, v]) / 2


def formulas_of(rate, t, y) -> Formulas:
    """The formulas of a rate."""
    return formulas(jax.make_jaxpr(rate)(t, y), t, y)


def operations(fn, *args) -> list:
    """The equations that fn is traced to, in order, those of inner programs too."""
    found = []

    def walk(jaxpr):
        for eqn in jaxpr.eqns:
            found.append(eqn)
            for sub in jaxprs_in_params(eqn.params):
                walk(sub)

    walk(jax.make_jaxpr(fn)(*args).jaxpr)
    return found


def primitives(fn, *args) -> list[str]:
    """Names of the operations that fn is traced to."""
    return [eqn.primitive.name for eqn in operations(fn, *args)]


class Arm(Mechanism):
    """A pendulum of length 2 m and mass 3 kg; angle from below."""

    def coordinates(self):
        return (("theta", "rad"),)

    def masses(self):
        return jnp.array([3.0])

    def positions(self, t, q):
        return 2.0 * jnp.stack([jnp.sin(q[0]), -jnp.cos(q[0])])[None]


class Yukawa(CentralForce):
    """A central force given by its energy."""

    def energy(self, r):
        return -jnp.exp(-r) / r


class Gauss(CentralForce):
    """A central force given by its attraction."""

    def attraction(self, r):
        return r * jnp.exp(-r * r / 2)
