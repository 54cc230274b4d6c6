"""How long do many bodies take at equal true error, and how long does one pair of them take?

Run: ``python -m benchmarks bodies``. Clusters of 16 to 1024 bodies that attract each other, and
chains of as many springs, with the default solver against heyoka's compact mode and, for gravity,
REBOUND's IAS15. Then the time of the forces per ordered pair, in a compiled loop.
A pair takes 18 additions and multiplications, a square root and a division; the last two alone
take 3.4 cycles in vectors of 256 bits [Agner Fog's tables, Zen 4: 9 and 5 cycles for four], 0.9 ns
at 3.7 GHz.

Last numbers (2 cores, 2026-11), ours over heyoka's at errors of 1e-6, 1e-9, 1e-12: gravity of 16
bodies 0.22, 0.15, 0.08, of 64 0.16, 0.12, 0.11, of 256 0.07, 0.03, 0.02; springs of 16 bodies 0.49,
0.30, 0.24, of 64 0.58, 0.32, 0.18, of 256 0.41, 0.32, 0.28, of 1024 0.51, 0.25, 0.21. Over
REBOUND's: at most 0.12, 0.35, 0.17 and 0.11 with 16, 64, 256 and 1024 bodies. A pair takes 1.6 to
2.1 ns from 16 to 1024 bodies, on a faster machine 1.1 to 1.3. A compiled solve holds 16 to 17
states beside its arguments from 16 to 1024 attracting bodies, 12 to 17 with springs.
"""

import functools

import jax
import numpy as np

from benchmarks._peers import importable
from benchmarks._timing import Curves, Method, Row, Run, Times, interleave, work_precision
from jaxdyn.effects import PairGravity, SpringNetwork
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.simulation import solve
from jaxdyn.scene import Scene

#: True errors compared at.
ERRORS = (1e-6, 1e-9, 1e-12)
TOLERANCES = tuple(float(f"1e-{e}") for e in range(5, 16))
#: Tolerances if building takes long: heyoka needs half a minute for 256 bodies.
_FEW, _FEW_FROM = TOLERANCES[::4], 256
#: Used for ours too, whose order 12 reaches the largest of these errors with them.
_LOOSE = (1e-3, 1e-4)
SIZES = (16, 64, 256, 1024)
_TO_HEYOKA, _TO_REBOUND = 0.7, 0.5
_HEYOKA_MOST = 256  # pairs of bodies: compact mode takes minutes to build 1024
_STIFFNESS, _REST = 2.0, 0.5  # [1] of the chains
_PAIRS = 2_000_000  # per timed run
_ROUNDS, _QUICK_ROUNDS = 10, 2


def run(quick: bool = False) -> list[Row | Curves]:
    """Gravity, springs, and the forces alone."""
    rounds, sizes = (_QUICK_ROUNDS, SIZES[:1]) if quick else (_ROUNDS, SIZES)
    return [
        *(gravity(n, rounds) for n in sizes),
        *(springs(n, rounds) for n in sizes),
        *(_pair(n, rounds) for n in sizes),
    ]


def cluster(n: int) -> Scene:
    """Bodies at random places, slow enough to stay together; larger clusters for a shorter span."""
    random = np.random.default_rng(n)
    r, v = random.normal(size=(2, n, 3))
    y0 = np.concatenate([r.ravel(), 0.3 * v.ravel()])
    return Scene(FreePoints(np.full(n, 1 / n), d=3), (PairGravity(1.0),), y0=y0, t1=32 / n)


def chain(n: int) -> Scene:
    """A stretched chain of unit masses with small initial velocities."""
    random = np.random.default_rng(n)
    r = np.arange(n)[:, None] * np.eye(3)[0] + 0.1 * random.normal(size=(n, 3))
    y0 = np.concatenate([r.ravel(), 0.1 * random.normal(size=3 * n)])
    links = [(i, i + 1) for i in range(n - 1)]
    network = SpringNetwork(links, _STIFFNESS, _REST)
    return Scene(FreePoints(np.ones(n), d=3), (network,), y0=y0, t1=10.0)


def gravity(n: int, rounds: int) -> Curves:
    """Error against time for a cluster."""
    methods = {}
    if n <= _HEYOKA_MOST and importable("heyoka"):
        methods["heyoka compact"] = Method(functools.partial(_heyoka_gravity, n), _ladder(n))
    if importable("rebound"):
        methods["REBOUND IAS15"] = Method(functools.partial(_rebound, cluster(n)), _ladder(n))
    return _curves(f"gravity, {n} bodies", cluster(n), methods, rounds)


def springs(n: int, rounds: int) -> Curves:
    """Error against time for a chain."""
    methods = {}
    if importable("heyoka"):
        methods["heyoka compact"] = Method(functools.partial(_heyoka_springs, n), _ladder(n))
    return _curves(f"springs, {n} bodies", chain(n), methods, rounds)


def _curves(name: str, scene: Scene, others: dict[str, Method], rounds: int) -> Curves:
    def build(tolerance: float) -> Run:
        return lambda: np.asarray(solve(scene, scene.t1, rtol=tolerance).y1)

    # The truth comes from another method, so that none is compared with itself; the last one is
    # built fastest.
    reference = next(reversed(others.values()), Method(build, TOLERANCES))
    truth = reference.build(1e-16)()
    bars = {"heyoka compact": (_TO_HEYOKA,) * 3, "REBOUND IAS15": (_TO_REBOUND,) * 3}
    methods = {"jaxdyn": Method(build, (*_LOOSE, *TOLERANCES))} | others
    return work_precision(name, methods, truth, ERRORS, rounds, bars)


def _ladder(n: int) -> tuple[float, ...]:
    return TOLERANCES if n < _FEW_FROM else _FEW


def _pair(n: int, rounds: int) -> Row:
    """The time of an ordered pair, as a row of seconds."""
    scene, repeats = cluster(n), max(4, _PAIRS // n**2)
    effect, (r, v, m) = scene.effects[0], scene.system.points(0.0, scene.y0)

    @jax.jit
    def forces(r):
        def again(_, r):
            return r + 1e-9 * effect.force(0.0, r, v, m)

        return jax.lax.fori_loop(0, repeats, again, r)

    times = interleave({"jaxdyn": lambda: np.asarray(forces(r))}, rounds)["jaxdyn"]
    return Row(f"a pair of {n}", {"jaxdyn": Times(*(t / repeats / n**2 for t in times))})


def _heyoka_gravity(n: int, tol: float) -> Run:
    import heyoka as hy

    scene = cluster(n)
    system = hy.model.nbody(n, masses=np.asarray(scene.system.m).tolist(), Gconst=1.0)
    # It orders states body by body: position and velocity of one, then of the next.
    start = np.asarray(scene.y0).reshape(2, n, 3).swapaxes(0, 1).ravel()
    end = _heyoka(system, start, tol, float(scene.t1))
    return lambda: end().reshape(n, 2, 3).swapaxes(0, 1).ravel()


def _heyoka_springs(n: int, tol: float) -> Run:
    import heyoka as hy

    r, v = (
        [[hy.expression(f"{kind}{axis}{i}") for axis in "xyz"] for i in range(n)] for kind in "rv"
    )
    pulls = [[[] for _ in range(3)] for _ in range(n)]
    for i in range(n - 1):
        d = [far - near for near, far in zip(r[i], r[i + 1], strict=True)]
        pull = _STIFFNESS * (1 - _REST / hy.sqrt(hy.sum([x * x for x in d])))
        for axis, x in enumerate(d):
            pulls[i][axis].append(pull * x)
            pulls[i + 1][axis].append(-pull * x)
    places = [(r[i][c], v[i][c]) for i in range(n) for c in range(3)]
    speeds = [(v[i][c], hy.sum(pulls[i][c])) for i in range(n) for c in range(3)]
    scene = chain(n)
    return _heyoka(places + speeds, np.asarray(scene.y0), tol, float(scene.t1))


def _heyoka(system: list, start: np.ndarray, tol: float, t1: float) -> Run:
    import heyoka as hy

    integrator = hy.taylor_adaptive(system, start, tol=tol, compact_mode=True)

    def run() -> np.ndarray:
        integrator.time = 0.0
        integrator.state[:] = start
        integrator.propagate_until(t1)
        return integrator.state.copy()

    return run


def _rebound(scene: Scene, epsilon: float) -> Run:
    import rebound

    n = len(scene.system.m)
    r, v = np.asarray(scene.y0).reshape(2, n, 3)

    def run() -> np.ndarray:
        bodies = rebound.Simulation()
        bodies.integrator = "ias15"
        bodies.integrator.epsilon = epsilon
        for m, (x, y, z), (vx, vy, vz) in zip(np.asarray(scene.system.m), r, v, strict=True):
            bodies.add(m=m, x=x, y=y, z=z, vx=vx, vy=vy, vz=vz)
        bodies.integrate(float(scene.t1))
        ends = [[p.xyz for p in bodies.particles], [p.vxyz for p in bodies.particles]]
        return np.array(ends).ravel()

    return run
