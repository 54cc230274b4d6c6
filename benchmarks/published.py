"""Which numbers of published periodic orbits are reproduced to the last digit?

Run: ``python -m benchmarks published [NAME...] [--json FILE]``; all rows by default, which take a
few minutes. Each row finds an orbit of a published table from the digits printed there, with public
functions only, and compares it with the printed numbers: by how many units of the last digit they
differ, and whether the verdict on the stability is the published one. `recheck` is the closing
error of the orbit at another tolerance. The results are stored in ``published.json`` beside this
file.

Last numbers (2026-11): of 87 numbers 58 are within one unit. The others: the six periods of 2013
that are printed with four decimals have two or three (butterfly I 6.2356, and 6.2346748391 in 2017,
ours 6.2346748387); four of 2017 differ by 3 to 10 units, that of yin-yang I b by 616,
and heyoka in long doubles has ours; 17 of Broucke's orbits, members of families that the
period and the closing do not single out: the nearest ones are 1e-5 away; the period of the
butterfly in JPL's database, in its twelfth decimal. No published verdict differs.
"""

import json
import math
from collections.abc import Callable, Sequence
from decimal import Decimal
from pathlib import Path
from typing import Annotated, NamedTuple

import jax.numpy as jnp
import mpmath as mp
import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn._checks import choice
from jaxdyn.effects import PairGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate import events

STORED = Path(__file__).with_name("published.json")


class Compared(NamedTuple):
    """A published number beside ours.

    Attributes:
      what: the number.
      published: its digits as printed.
      ours: the number found.
      recheck: closing error of the orbit at another tolerance; None if it is not an orbit.
      verdict: verdict on its stability; empty if it was not computed.
      said: the published verdict; empty if there is none.
    """

    what: str
    published: str
    ours: float
    recheck: float | None = None
    verdict: str = ""
    said: str = ""

    @property
    def units(self) -> float:
        """The difference in units of the last digit printed."""
        last = Decimal(self.published).as_tuple().exponent
        assert isinstance(last, int)
        return float((Decimal(self.ours) - Decimal(self.published)).scaleb(-last))

    @property
    def agrees(self) -> bool:
        """Whether all rounded digits and the verdict are the same."""
        return abs(self.units) <= 1.0 and self.verdict in (self.said or self.verdict, "undecided")


class Row(NamedTuple):
    """An orbit of a published table, or a few: the source, and how to find them."""

    source: str
    run: Callable[[], list[Compared]]


def main(
    names: Annotated[list[str] | None, typer.Argument(help="Rows to run; all by default.")] = None,
    stored: Annotated[Path, typer.Option("--json", help="The file for the results.")] = STORED,
) -> None:
    """Published numbers beside ours."""
    jaxdyn.configure()
    results = json.loads(stored.read_text()) if stored.is_file() else {}
    for name in names or ROWS:
        choice("name", name, ROWS)
        found = ROWS[name].run()
        results[name] = {"source": ROWS[name].source, "numbers": [as_json(x) for x in found]}
        stored.write_text(json.dumps(results, indent=1) + "\n")
        Console(width=150).print(table(name, found))


def as_json(one: Compared) -> dict:
    """A comparison with the quantities derived from it."""
    return one._asdict() | {"units": round(one.units, 2), "agrees": one.agrees}


def table(name: str, found: Sequence[Compared]) -> Table:
    """The comparisons of a row."""
    shown = Table(box=None, title=f"{name}: {ROWS[name].source}", title_justify="left")
    for column in ("", "published", "ours", "units", "recheck", "verdict", "published"):
        shown.add_column(column, no_wrap=True)
    for one in found:
        recheck = "" if one.recheck is None else f"{one.recheck:.0e}"
        units = f"{one.units:.2g}" if one.agrees else f"{one.units:.2g} differs"
        shown.add_row(
            one.what, one.published, f"{one.ours:.12g}", units, recheck, one.verdict, one.said
        )
    return shown


def _of_orbit(orbit: orbits.Orbit, numbers: dict[str, tuple[str, float]], said: str = ""):
    """The comparisons of an orbit's numbers, each printed and ours."""
    recheck, verdict = orbits.recheck(orbit).closure, orbits.stability(orbit).verdict
    return [Compared(what, *both, recheck, verdict, said) for what, both in numbers.items()]


def in_line() -> list[Compared]:
    """Bodies that start in line: velocities and period, from five or ten digits."""
    found = []
    for name, a, b, period, later in (
        ("figure-eight", "0.3471168881", "0.5327249454", "6.3259139829", "6.3259139829"),
        ("butterfly I", "0.30689", "0.12551", "6.2356", "6.2346748391"),
        ("moth I", "0.46444", "0.39606", "14.8939", "14.8943051743"),
        ("goggles", "0.08330", "0.12789", "10.4668", "10.4648495256"),
        ("dragonfly", "0.08058", "0.58884", "21.2710", "21.2723373956"),
        ("yin-yang I a", "0.51394", "0.30474", "17.3284", ""),
        ("yin-yang I b", "0.28270", "0.32721", "10.9626", "10.9633031497"),
    ):
        scene, seed = orbits.discovery.seeds.row(float(a), float(b), float(period))
        euler = orbits.reversal(orbits.point_symmetry([1, 0, 2], (-1, -1), reversing=True))
        hold = ("x1", "y1", "x2", "y2")
        orbit = orbits.find(scene, seed.y0, seed.period, closing=euler, hold=hold)
        y0 = np.asarray(orbit.y0)
        numbers = {"v1": (a, y0[6]), "v2": (b, y0[7]), "T": (period, orbit.period)}
        if later:
            numbers["T by Li, Liao"] = later, orbit.period
        found += _of_orbit(orbit, {f"{name}, {what}": both for what, both in numbers.items()})
    return found


def broucke() -> list[Compared]:
    """Bodies that start in line and move at right angles to it; relative periodic orbits."""
    found = []
    for name, x, v, period in (
        (
            "A1",
            (-0.9892620043, 2.2096177241, -1.2203557197),
            (1.9169244185, 0.1910268738, -2.1079512924),
            "6.283213",
        ),
        (
            "A2",
            (0.3361300950, 0.7699893804, -1.1061194753),
            (1.5324315370, -0.6287350978, -0.9036964391),
            "7.702408",
        ),
        (
            "A3",
            (0.3149337497, 0.8123820710, -1.1273158206),
            (1.4601869417, -0.5628292375, -0.8973577042),
            "7.910268",
        ),
    ):
        y0 = [number for at in x for number in (at, 0.0)] + [u for w in v for u in (0.0, w)]
        scene = scenes.three_body(y0, t1=float(period))
        # The nearest of a family that has this period; printed digits close to 5e-6.
        orbit = orbits.find(scene, closing=orbits.relative(), hold=orbits.Period(float(period)))
        at = [*np.asarray(orbit.y0)[[0, 2, 4]], *np.asarray(orbit.y0)[[7, 9, 11]]]
        names = [f"{letter}{i}" for letter in ("x", "vy") for i in (1, 2, 3)]
        printed = [f"{number:.6f}" for number in (*x, *v)]
        numbers = {f"{name}, {k}": both for k, *both in zip(names, printed, at, strict=True)}
        found += _of_orbit(orbit, numbers)
    return found


def choreographies() -> list[Compared]:
    """Four and five bodies on one curve, of period 2 pi."""
    four = [1.382857, 0.0], [0.0, 0.157030], [-1.382857, 0.0], [0.0, -0.157030]
    fast = [0.0, 0.584873], [1.871935, 0.0], [0.0, -0.584873], [-1.871935, 0.0]
    right, left = [0.439775, 0.169717], [-1.268608, 0.267651]
    five = [1.657666, 0.0], right, left, [left[0], -left[1]], [right[0], -right[1]]
    back, ahead = [-1.822785, 0.128248], [-1.271564, 0.168645]
    quick = [0.0, -0.593786], back, ahead, [-ahead[0], ahead[1]], [-back[0], back[1]]
    found = []
    for name, r, v in (("super-eight of four", four, fast), ("chain of five", five, quick)):
        y0 = np.ravel([r, v])
        period = 2 * math.pi
        scene = jaxdyn.Scene(FreePoints(np.ones(len(r))), (PairGravity(1.0),), y0=y0, t1=period)
        closing = orbits.choreography(len(r))
        orbit = orbits.find(scene, closing=closing, hold=[orbits.Period(period), "y1"])
        at = np.asarray(orbit.y0).reshape(2, len(r), 2)
        numbers = {
            "x1": (f"{r[0][0]:.6f}", at[0, 0, 0]),
            "y2": (f"{r[1][1]:.6f}", at[0, 1, 1]),
            "vy1": (f"{v[0][1]:.6f}", at[1, 0, 1]),
            "vx2": (f"{v[1][0]:.6f}", at[1, 1, 0]),
        }
        found += _of_orbit(orbit, {f"{name}, {what}": both for what, both in numbers.items()})
    return found


def arenstorf() -> list[Compared]:
    """The orbit about Earth and Moon of four loops."""
    start = {"x": 0.994, "y": 0.0, "vx": 0.0, "vy": -2.00158510637908252240537862224}
    scene = scenes.restricted_three_body(mu=0.012277471, **start, t1=17.06)
    mirror = orbits.Symmetry(signs=(1, -1, -1, 1), reversing=True)
    orbit = orbits.find(scene, closing=orbits.reversal(mirror), hold="x")
    numbers = {
        "vy": ("-2.0015851063790825", float(orbit.y0[3])),
        "T": ("17.0652165601579625", orbit.period),
    }
    # Doubles have 16 digits, and errors grow by 1e4 in a period.
    return _of_orbit(orbit, {what: (printed[:13], x) for what, (printed, x) in numbers.items()})


def gateway() -> list[Compared]:
    """The orbit of the Gateway in 9:2 resonance with the months."""
    start = {"x": 1.0220215127358174, "z": -0.1820967615242405, "vy": -0.10325634106279382}
    period = 1.5111111111111111
    scene = scenes.restricted_three_body_in_space(mu=1 / 82.30059, **start, t1=period)
    mirror = orbits.Symmetry(None, (1, -1, 1, -1, 1, -1), reversing=True)
    closing, held = orbits.reversal(mirror), orbits.Period(period)
    orbit = orbits.find(scene, closing=closing, hold=held)
    found = orbits.stability(orbit)
    pair = found.nontrivial[np.argmax(np.abs(found.nontrivial))]
    index = float(abs(pair + 1 / pair) / 2)
    return _of_orbit(orbit, {"stability index": ("1.32", index)})


def catalogue() -> list[Compared]:
    """Orbits of JPL's database: a halo orbit of Earth and Moon, a butterfly of Saturn and Titan."""
    found = []
    for name, mu, start, period, index, said in (
        (
            "halo",
            1.215058560962404e-02,
            (-4.1456184803140111e-01, 9.0753120433295065e-01, "1.4076145460136695"),
            "3.1233143922761588",
            "243.40572681337468",
            "unstable",
        ),
        (
            "butterfly",
            2.366393158331484e-04,
            (9.7753007347844856e-01, 3.9522030056289147e-02, "-0.011884747036685137"),
            "3.6919029518069890",
            "1.0000000000000000",
            "stable",
        ),
    ):
        x, z, vy = start
        scene = scenes.restricted_three_body_in_space(
            mu=mu, x=x, z=z, vy=float(vy), t1=float(period)
        )
        mirror = orbits.Symmetry(None, (1, -1, 1, -1, 1, -1), reversing=True)
        orbit = orbits.find(scene, closing=orbits.reversal(mirror), hold="x")
        largest = float(np.abs(orbits.stability(orbit).nontrivial).max())
        # 16 digits of starts whose errors grow by up to 1e3 in a period.
        numbers = {
            "z": (f"{z:.12f}", float(orbit.y0[2])),
            "vy": (f"{float(vy):.12f}", float(orbit.y0[4])),
            "T": (f"{float(period):.12f}", orbit.period),
            "stability index": (f"{float(index):.6f}", (largest + 1 / largest) / 2),
        }
        found += _of_orbit(orbit, {f"{name}, {what}": both for what, both in numbers.items()}, said)
    return found


def trio() -> list[Compared]:
    """Three bodies in space."""
    # As printed: else the start may move along the orbit, which turns and shifts with it.
    places = [f"{axis}{body}" for body in (1, 2, 3) for axis in "xyz" if (axis, body) != ("z", 3)]
    orbit = orbits.find(scenes.n_body(), hold=places)
    printed = {"z0": ("-0.0785343346337253", 8), "vx": ("0.196265689129450", 9)}
    numbers = {what: (text, float(orbit.y0[i])) for what, (text, i) in printed.items()}
    numbers["T"] = "7.19372451258599", orbit.period
    return _of_orbit(orbit, numbers, "stable")


def lorenz() -> list[Compared]:
    """The shortest cycle, AB."""
    guess = [-13.763610682134, -19.578751942452, 27.0]
    orbit = orbits.find(scenes.lorenz(), guess, 1.5586, hold=orbits.Section(2, 27.0))
    numbers = {
        "T": ("1.5586522107162", orbit.period),
        "x": ("-13.763610682134", float(orbit.y0[0])),
        "y": ("-19.578751942452", float(orbit.y0[1])),
    }
    return _of_orbit(orbit, numbers, "unstable")


def hodgkin_huxley(t, y, current):
    """Rates of an axon's voltage [mV, from rest] and gates, under a current [uA/cm^2]; in ms."""
    v, m, h, n = y

    def linoid(x):
        small = jnp.abs(x) < 1e-6
        return jnp.where(small, 1 - x / 2, x / jnp.expm1(jnp.where(small, 1.0, x)))

    sodium, potassium = 120 * m**3 * h * (v - 115), 36 * n**4 * (v + 12)
    return [
        current - sodium - potassium - 0.3 * (v - 10.599),
        linoid((25 - v) / 10) * (1 - m) - 4 * jnp.exp(-v / 18) * m,
        0.07 * jnp.exp(-v / 20) * (1 - h) - h / (jnp.exp((30 - v) / 10) + 1),
        0.1 * linoid((10 - v) / 10) * (1 - n) - 0.125 * jnp.exp(-v / 80) * n,
    ]


def axon() -> list[Compared]:
    """Where the resting state of an axon loses its stability, and where it regains it."""
    start = [0.0, 0.05, 0.6, 0.32]

    def make(current):
        return jaxdyn.ode(hodgkin_huxley, start, 20.0, params=current)

    equilibria = jaxdyn.continue_equilibria(make, 0.0, start, members=100)
    first, last = (x for x in equilibria.special[:2])
    return [
        Compared("first Hopf point", "9.7796", first.parameter),
        Compared("second Hopf point", "154.527", last.parameter),
    ]


def roessler() -> list[Compared]:
    """The shortest cycle, and its multiplier from the printed derivative of the return map."""

    def rate(t, y):
        return [-(y[1] + y[2]), y[0] + 0.2 * y[1], 0.2 + y[2] * (y[0] - 5.7)]

    scene = jaxdyn.ode(rate, [0.0, -8.38, 0.03], 5.9)
    orbit = orbits.find(scene, hold=orbits.Section(0, 0.0))
    large = orbits.stability(orbit).nontrivial[0].real
    numbers = {
        "y": ("-8.38094174283", float(orbit.y0[1])),
        "z": ("0.0295900606307", float(orbit.y0[2])),
        "T": ("5.881088455554", orbit.period),
        "multiplier": ("-2.40395353", large),
    }
    return _of_orbit(orbit, numbers, "unstable")


def halo() -> list[Compared]:
    """An orbit about the first point of libration, for a mass ratio of 0.04."""
    start = {"x": 0.723, "z": 0.04, "vy": 0.198}
    scene = scenes.restricted_three_body_in_space(mu=0.04, **start, t1=2.6)
    mirror = orbits.Symmetry(None, (1, -1, 1, -1, 1, -1), reversing=True)
    orbit = orbits.find(scene, closing=orbits.reversal(mirror), hold="z")
    numbers = {
        "x": ("0.723268", float(orbit.y0[0])),
        "vy": ("0.198019", float(orbit.y0[4])),
        "T / 2": ("1.300177", orbit.period / 2),
    }
    return _of_orbit(orbit, numbers, "unstable")


def ring() -> list[Compared]:
    """Bodies on a ring about a heavy one: its angular velocity, in closed form."""
    n, heavy = 7, 200.0
    turns = 2 * np.pi * np.arange(n) / n
    exact = math.sqrt(heavy + 0.25 * sum(1 / math.sin(math.pi * k / n) for k in range(1, n)))
    r = np.array([[0.0, 0.0], *np.transpose([np.cos(turns), np.sin(turns)])])
    v = 1.001 * exact * np.array([[-y, x] for x, y in r])
    masses = np.array([heavy, *np.ones(n)])
    part = 2 * math.pi / (n * exact)
    system = FreePoints(masses)
    scene = jaxdyn.Scene(system, (PairGravity(1.0),), y0=np.ravel([r, v]), t1=n * part)
    bodies = (0, *(np.arange(n) + 1) % n + 1)
    follow = orbits.point_symmetry([int(i) for i in bodies], (1, 1))
    closing = orbits.Return(symmetry=follow, parts=n)
    orbit = orbits.find(scene, closing=closing, hold=("x1", "y1", "x2", "y2"))
    return _of_orbit(orbit, {"T": (f"{n * part:.12f}", orbit.period)}, "")


def sitnikov() -> list[Compared]:
    """A light body on the axis of two that circle each other: the period as a quadrature."""
    height = 1.0

    def rate(t, y):
        z, v = y
        return [v, -z / (z * z + 0.25) ** 1.5]

    def energy(t, y):
        return 0.5 * y[1] ** 2 - 1 / jnp.sqrt(y[0] ** 2 + 0.25)

    scene = jaxdyn.ode(rate, [height, 0.0], 4.0, energy=energy)
    orbit = orbits.find(scene, period=5.8, hold=("y0", "y1"))
    with mp.workdps(30):
        far = mp.sqrt(height**2 + mp.mpf(1) / 4)

        def slowness(angle):
            near = mp.sqrt((height * mp.sin(angle)) ** 2 + mp.mpf(1) / 4)
            return mp.sqrt(near * far * (near + far) / 2)

        exact = mp.nstr(4 * mp.quad(slowness, [0, mp.pi / 2]), 13)
    return _of_orbit(orbit, {"T": (exact, orbit.period)})


def straight() -> list[Compared]:
    """Energies, in sixths, at which other orbits branch off from the straight one."""
    scene = scenes.henon_heiles().starting([0.0, 0.8, 0.0, 0.0])
    first = orbits.find(scene, period=8.5, hold="y")
    family = orbits.continue_family(first, members=40, step=0.05, energies=(0.0, 0.165))
    places = [6 * x.energy for x in family.special if x.kind == orbits.Kind.BRANCH]
    return [
        Compared(f"energy of {name}", printed, place)
        for name, printed, place in zip(("R5", "L6"), ("0.969309", "0.986709"), places, strict=True)
    ]


def driven_pendulum() -> list[Compared]:
    """The strength of the forcing at which the period doubles."""

    def rate(t, y, strength):
        angle, speed = y
        own = 3 * math.pi  # its own frequency: 1.5 times that of the drive
        drive = strength * own**2 * jnp.cos(2 * math.pi * t)
        return [speed, -own / 2 * speed - own**2 * jnp.sin(angle) + drive]

    def make(strength):
        return jaxdyn.ode(rate, [-math.pi / 2, 0.0], 1.0, params=strength)

    # The motion from the printed start, once it has settled.
    settled = jaxdyn.simulate(make(1.06), 40.0).ys[-1]
    first = orbits.find(make(1.06), settled, 1.0)
    family = orbits.continue_family(first, make, 1.06, members=30, within=(1.0, 1.075))
    (point,) = (x for x in family.special if x.kind == orbits.Kind.DOUBLING)
    return [Compared("first period doubling", "1.0663", point.parameter)]


class _Strikes(events.Event):
    """The swing foot of the walker is on the slope."""

    def value(self, t, y):
        return y[1] - 2 * y[0]


def walker() -> list[Compared]:
    """The gait of the simplest walker on a slope of 0.009, and the slope of period doubling."""

    def rate(t, y, slope):
        stance, swing, stance_rate, swing_rate = y
        pull = jnp.sin(stance - slope)
        fall = stance_rate**2 * jnp.sin(swing) - jnp.cos(stance - slope) * jnp.sin(swing)
        return [stance_rate, swing_rate, pull, pull + fall]

    def changes_feet(t, y):
        stance, _, speed, _ = y
        c = jnp.cos(2 * stance)
        return jnp.stack([-stance, -2 * stance, c * speed, c * (1 - c) * speed])

    def walks(slope: float, stance: float, speed: float) -> orbits.HybridOrbit:
        start = [stance, 2 * stance, speed, (1 - math.cos(2 * stance)) * speed]
        scene = jaxdyn.ode(rate, start, 3.9, params=slope)
        return orbits.find_hybrid([orbits.Leg(scene, (_Strikes(),), changes_feet)], start, [3.85])

    gait, doubling = walks(0.009, 0.2, -0.2), walks(0.0150884379, 0.237, -0.23)
    verdict = orbits.stability(gait).verdict
    values = orbits.stability(doubling).nontrivial
    least = float(values[np.argmin(np.abs(values + 1))].real)
    return [
        Compared("stance angle", "0.2003109", float(gait.y0[0]), None, verdict, "stable"),
        Compared("its rate", "-0.1998325", float(gait.y0[2]), None, verdict, "stable"),
        Compared("multiplier at slope 0.0150884379", "-1.000000", least),
    ]


#: The rows by name.
ROWS = {
    "in line": Row(
        "Suvakov, Dmitrasinovic (2013), Phys. Rev. Lett. 110, 114301; Li, Liao (2017), Sci. China "
        "Phys. Mech. Astron. 60, 129511",
        in_line,
    ),
    "Broucke": Row("Broucke (1975), Celest. Mech. 12, 439", broucke),
    "choreographies": Row(
        "Simo (2001), Progr. Math. 201, 101: New families of solutions in N-body problems; that of "
        "four is Gerver's",
        choreographies,
    ),
    "catalogue": Row("NASA/JPL Three-Body Periodic Orbits API, version 1.0", catalogue),
    "Arenstorf": Row("Hairer, Norsett, Wanner (1993), Solving ODEs I, (II.0.1)", arenstorf),
    "Gateway": Row("studies of the near-rectilinear halo orbit in 9:2 resonance", gateway),
    "trio": Row("Li, Liao (2025), arXiv:2508.08568, O_1(0.3)", trio),
    "Roessler": Row("CAPD::DynSys, the example of Poincare maps: its printed output", roessler),
    "halo": Row("Howell (1984), Celest. Mech. 32, 53, for mu = 0.04", halo),
    "ring": Row(
        "Maxwell (1859), On the Stability of the Motion of Saturn's Rings; Vanderbei, Kolemen "
        "(2007), Astron. J. 133, 656",
        ring,
    ),
    "Sitnikov": Row(
        "MacMillan (1911), Astron. J. 27, 11: the period as a quadrature, here by mpmath", sitnikov
    ),
    "Henon-Heiles": Row("Brack (2001), Found. Phys. 31, 209", straight),
    "driven pendulum": Row(
        "Taylor (2005), Classical Mechanics, chapter 12: frequencies 2 pi and 3 pi", driven_pendulum
    ),
    "Lorenz": Row("Viswanath (2004), Physica D 190, 115", lorenz),
    "walker": Row("Garcia, Chatterjee, Ruina, Coleman (1998), J. Biomech. Eng. 120, 281", walker),
    "axon": Row(
        "Rinzel, Miller (1980), Biol. Cybern. 37, 1; Hassard (1978), J. Theor. Biol.", axon
    ),
}


if __name__ == "__main__":
    typer.run(main)
