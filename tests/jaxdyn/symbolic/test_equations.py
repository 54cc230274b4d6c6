"""Printed equations of motion: against the rates that they are read from, and against textbooks."""

import math
import re
import sys
from xml.etree import ElementTree

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import refusal

import jaxdyn
from jaxdyn import Effect, effects, scenes
from jaxdyn.analysis import constraints, energy
from jaxdyn.analysis.free_body import free_body
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.formulations.rigid import RigidBody, about_centre
from jaxdyn.mechanisms.euler_body import EulerBody
from jaxdyn.scenes import catalogue
from jaxdyn.symbolic import parameters, with_parameters
from jaxdyn.symbolic.algebra import ONE, Expression, Group, Symbol, as_expression
from jaxdyn.symbolic.deriving import derive
from jaxdyn.symbolic.symbols import GREEK
from jaxdyn.symbolic.typesetting import TEXT

ZOO = catalogue.entries()
#: Tolerance relative to the size of a rate.
ROUNDING = 1e-13
STATES = 4

#: The same for a four-bar linkage, with numbers for which nothing cancels.
UNEQUAL = {"m": (1.0, 2.0, 3.0), "length": (1.0, 2.5, 2.2), "angle": 1.0, "rate": 0.7, "g": 9.81}

#: Scenes beyond the defaults of the catalogue: other formulations, and effects of all kinds.
BESIDES = {
    **{
        f"{name} {formulation}": lambda name=name, formulation=formulation: ZOO[name].make(
            formulation=formulation
        )
        for name in ("pendulum", "cart_pendulum", "double_pendulum", "bead_on_parabola")
        for formulation in ("lagrange", "constrained")
    },
    "two point masses": lambda: scenes.double_pendulum(uniform=False),
    "squared distance": lambda: scenes.dumbbell(tie="square"),
    "squared length": lambda: scenes.pendulum(formulation="constrained", tie="square"),
    "angles from bar to bar": lambda: scenes.double_pendulum(uniform=False, relative=True),
    "point masses on rods": lambda: scenes.double_pendulum(
        uniform=False, formulation="constrained"
    ),
    "quadratic drag": lambda: scenes.cannonball(m=2.0) + effects.QuadraticDrag(0.1),
    "drag in wind": lambda: scenes.cannonball() + effects.LinearDrag(0.1, wind=[1.0, 2.0]),
    "dry friction": lambda: scenes.oscillator() + effects.DryFriction(0.3, 9.81, creep=0.01),
    "dashpot": lambda: scenes.two_masses() + effects.Dashpot(0.5, i=0, j=1),
    "spring on a pendulum": lambda: scenes.pendulum() + effects.Spring(3.0, 0.5, anchor=[1.0, 0.2]),
    "drag on a pendulum": lambda: scenes.double_pendulum() + effects.LinearDrag(0.2),
    "force on a pendulum": lambda: (
        scenes.cart_pendulum() + effects.SinusoidalForce([1.0, 0.0], 2.0, 0.5, on=(0,))
    ),
    "test particle": lambda: scenes.n_body(m=(1.0, 0.0, 1.0)),
    "box by Euler angles": lambda: scenes.box(representation="euler"),
    "smooth ground": lambda: scenes.rolling_disk(rough=False),
    "stabilised": lambda: scenes.double_pendulum(formulation="constrained", drift="baumgarte"),
    "top by Euler angles": lambda: scenes.top(representation="euler"),
    "drag on a top": lambda: scenes.top() + effects.LinearDrag(0.01),
    "top by a matrix": lambda: scenes.top(representation="matrix"),
    "crank": lambda: scenes.four_bar(formulation="newton_euler"),
    "crossed crank": lambda: scenes.four_bar(**UNEQUAL, formulation="lagrange", crossed=True),
    "drag on a linkage": lambda: (
        scenes.four_bar(**UNEQUAL, formulation="newton_euler") + effects.LinearDrag(0.2)
    ),
    "damper in a crank": lambda: (
        scenes.four_bar(**UNEQUAL, formulation="lagrange") + effects.HingeDamper(0.3)
    ),
    "dashpots": lambda: scenes.two_springs(c_a=0.2, c_b=0.3, c_d=0.1, anchor_b=(0.8, 0.6)),
    "dashpot of a pair": lambda: scenes.two_body() + effects.Dashpot(0.3, i=0, j=1),
    "polar with a force": lambda: scenes.polar_particle() + effects.PowerLaw(2.0, -2.0),
}


def _on_constraints(scene, t, y):
    near = getattr(scene.system, "nearest", scene.system.project)
    for _ in range(3):
        y = near(jnp.asarray(t), jnp.asarray(y))
    return np.asarray(y)


def _with_other_numbers(scene, rng):
    values = parameters(scene).values
    other = with_parameters(scene, values * rng.uniform(0.8, 1.2, len(values)))

    def body_of(scene):
        return getattr(scene.system, "mechanism", scene.system)

    body = body_of(other)
    if isinstance(body, EulerBody | RigidBody) and not body.pivoted:
        # Its points are about their mass centre.
        other = eqx.tree_at(lambda x: body_of(x).matter, other, about_centre(body.matter))
    return other.starting(_on_constraints(other, 0.0, other.y0))


@pytest.mark.sample(
    "cannonball",
    "car",
    "cylinder_on_ramp",
    "hill",
    "lorenz",
    "n_body",
    "pendulum",
    "shaken_pendulum",
    "angles from bar to bar",
    "quadratic drag",
    "spring on a pendulum",
    "drag on a top",
    "dashpot",
)
@pytest.mark.parametrize("name", [*ZOO, *BESIDES])
def test_what_is_printed_is_the_rate(name):
    rng = np.random.default_rng(0)
    scene = _with_other_numbers(ZOO[name].make() if name in ZOO else BESIDES[name](), rng)
    found = jaxdyn.equations(scene)
    y0 = np.asarray(scene.y0)
    rate = jax.jit(lambda scene, t, y: scene.rate(t, y))
    for t in rng.uniform(0.1, 1.0, STATES):
        y = y0 + 0.03 * (1.0 + abs(y0)) * rng.standard_normal(len(y0))
        y = _on_constraints(scene, t, y)
        wanted = np.asarray(rate(scene, t, y))
        assert np.abs(found.rate(t, y) - wanted).max() <= ROUNDING * np.abs(wanted).max()


@pytest.mark.parametrize(
    ("name", "count"),
    [("ball_on_table", 1), ("impact_oscillator", 1), ("rimless_wheel", 2), ("simplest_walker", 1)],
)
def test_impacts_in_print_are_those_of_the_phases(name, count):
    scene = ZOO[name].make()
    found = jaxdyn.equations(scene)
    printed = next(part for part in found.sections if part.name == "impacts").lines
    (phase,) = (x for x in scenes.phases_of(scene).values() if x.scene.system is scene.system)
    assert len(phase.exits) == count
    states = np.random.default_rng(5).normal(size=(STATES, len(scene.y0)))
    state = derive(scene).symbols.state
    for y in states:
        values = found.at(0.0, y)
        rest = list(printed)
        for way in phase.exits:
            where = rest.pop(0)
            place = where.left.value(values) - where.right.value(values)
            assert abs(place) == pytest.approx(abs(float(way.event.value(0.0, jnp.asarray(y)))))
            after = dict(zip([f"{s.name}+" for s in state], y, strict=True))
            while rest and next(iter(rest[0].left.symbols())).name in after:
                line = rest.pop(0)
                after[next(iter(line.left.symbols())).name] = line.right.value(values)
            wanted = getattr(way.change, "law", way.change)(0.0, y)
            np.testing.assert_allclose(list(after.values()), wanted, rtol=ROUNDING, atol=ROUNDING)
        assert not rest


def test_smooth_scenes_and_rolling_have_no_impacts():
    for scene in (scenes.pendulum(), scenes.cylinder_on_ramp()):
        assert "impacts" not in [part.name for part in jaxdyn.equations(scene).sections]


#: A token of printed text: a name with its primes, a number, or a sign.
_TOKEN = re.compile(r"[A-Za-z]\w*(?:,\d+)?'*|\d+(?:\.\d+)?(?:e[-+]?\d+)?|[-+/^(),|]")
_CALLS = {
    **{name: getattr(math, name) for name in ("sin", "cos", "tan", "sqrt", "log", "tanh")},
    **{"arcsin": math.asin, "arccos": math.acos, "arctan": math.atan},
    **{"sgn": np.sign, "H": lambda x: float(x >= 0)},
}


def read_back(text, values):
    """The value of a printed expression, read as a person reads it: from left to right."""
    tokens = [*_TOKEN.findall(text), "end"]
    assert "".join(tokens[:-1]) == text.replace(" ", "")

    def expression():
        sign = -1 if tokens[0] == "-" and tokens.pop(0) else 1
        found = sign * product()
        while tokens[0] in ("+", "-"):
            sign = 1 if tokens.pop(0) == "+" else -1
            found += sign * product()
        return found

    def product():
        found = power()
        while tokens[0] not in ("+", "-", ")", "|", ",", "end") or opens():
            found = found / power() if tokens[0] == "/" and tokens.pop(0) else found * power()
        return found

    depth = []

    def opens():  # a bar that begins a size: none is open
        return tokens[0] == "|" and not depth

    def power():
        function = tokens.pop(0) if tokens[0] in _CALLS and tokens[0] not in values else None
        exponent = raised() if function else 1
        base = atom() if function is None else _CALLS[function](atom())
        return base ** (exponent if function else raised())

    def raised():
        return atom() if tokens[0] == "^" and tokens.pop(0) else 1

    def atom():
        token = tokens.pop(0)
        if token in "(|":
            depth.extend("|" * (token == "|"))
            found = expression()
            assert tokens.pop(0) == {"(": ")", "|": "|"}[token]
            return abs(depth.pop() and found) if token == "|" else found
        if token[0].isdigit():
            return float(token)
        return math.pi if token == "pi" else values[token]

    found = expression()
    assert tokens == ["end"]
    return found


@pytest.mark.sample("car", "n_body", "power_law", "top", "two_masses", "dry friction")
@pytest.mark.parametrize("name", [*ZOO, *BESIDES])
def test_text_means_what_it_says(name):
    scene = ZOO[name].make() if name in ZOO else BESIDES[name]()
    found = jaxdyn.equations(scene)
    rng, y0 = np.random.default_rng(2), np.asarray(scene.y0)
    values = found.at(0.4, y0 + 0.03 * (1.0 + abs(y0)) * rng.standard_normal(len(y0)))
    sides = [x for part in found.sections for line in part.lines for x in line]
    for more in (found.equilibria, found.jacobian):
        try:
            printed = more()
        except ValueError:  # the scene has none
            continue
        rows = getattr(printed, "rows", {"": ()})
        sides += [x for matrix in rows.values() for row in matrix for x in row]
        lines = [line for part in getattr(printed, "sections", ()) for line in part.lines]
        sides += [x for line in lines for x in line]
    for x in sides:
        values |= {s: rng.uniform(0.5, 1.5) for s in x.symbols() if s not in values}
        named = {TEXT.symbol(s): value for s, value in values.items()}
        wanted = x.value(values)
        assert abs(read_back(TEXT.expression(x), named) - wanted) <= 1e-12 * (1 + abs(wanted))


def test_a_sum_that_is_subtracted_is_in_brackets():
    a, b, c = (as_expression(Symbol(name, "parameter", rank=i)) for i, name in enumerate("abc"))
    bracket = Group(b + c)
    assert TEXT.expression(a - Expression({((bracket, ONE),): ONE})) == "a - (b + c)"
    assert TEXT.expression(Expression({((bracket, ONE),): -ONE})) == "-(b + c)"
    assert TEXT.expression(Expression({((bracket, ONE),): ONE})) == "b + c"


@pytest.mark.sample("cannonball", "power_law", "top", "two_masses")
@pytest.mark.parametrize("name", [*ZOO, *BESIDES])
def test_energies_in_print_are_those_of_the_scene(name):
    scene = ZOO[name].make() if name in ZOO else BESIDES[name]()
    found = jaxdyn.equations(scene)
    lines = [line for part in found.sections if part.name == "energies" for line in part.lines]
    if not lines or "L" in {TEXT.expression(line.left) for line in lines}:
        return
    rng, y0 = np.random.default_rng(3), np.asarray(scene.y0)
    y = y0 + 0.03 * (1.0 + abs(y0)) * rng.standard_normal(len(y0))
    y = _on_constraints(scene, 0.4, y)
    wanted = float(energy.energy(scene, 0.4, jnp.asarray(y)))
    terms = [line for line in lines if TEXT.expression(line.left) in "TV"] or lines
    printed = [line.right.value(found.at(0.4, y)) for line in terms]
    assert abs(sum(printed) - wanted) <= ROUNDING * sum(map(abs, printed))


def _motion(scene):
    return jaxdyn.equations(scene).text("motion").splitlines()[1:]


#: What a textbook prints, term by term.
TEXTBOOK = {
    "pendulum": ["theta'' = -(g/l) sin(theta)"],
    "squared length": [
        "m x'' = lambda x/l",
        "m y'' + m g = lambda y/l",
        "x x'' + y y'' + x'^2 + y'^2 = 0",
    ],
    "squared distance": [
        "m1 x1'' = lambda (x1 - x2)/l",
        "m1 y1'' = lambda (y1 - y2)/l",
        "m2 x2'' = lambda (x2 - x1)/l",
        "m2 y2'' = lambda (y2 - y1)/l",
        "(x1 - x2) x1'' + (y1 - y2) y1'' + (x2 - x1) x2'' + (y2 - y1) y2''"
        " + (x1' - x2')^2 + (y1' - y2')^2 = 0",
    ],
    "cart_pendulum": [
        "(m1 + m2) x'' + m2 l theta'' cos(theta) - m2 l theta'^2 sin(theta) = 0",
        "x'' cos(theta) + l theta'' + g sin(theta) = 0",
    ],
    "two point masses": [
        "(m1 + m2) l1 theta1'' + m2 l2 theta2'' cos(theta1 - theta2)"
        " + m2 l2 theta2'^2 sin(theta1 - theta2) + (m1 + m2) g sin(theta1) = 0",
        "l1 theta1'' cos(theta1 - theta2) + l2 theta2''"
        " - l1 theta1'^2 sin(theta1 - theta2) + g sin(theta2) = 0",
    ],
    "shaken_pendulum": ["theta'' = 3 (g + a Omega^2 cos(Omega t)) sin(theta)/(2 l)"],
    "cannonball": ["x'' = 0", "y'' = -g"],
    "quadratic drag": ["m x'' = -c v x'", "m y'' = -c v y' - m g"],
    "oscillator": ["x'' = -(k/m) x"],
    "spring_mass": ["m x'' = -k (r - l0) x/r", "m y'' = -k (r - l0) y/r - m g"],
    "bead_on_parabola": ["(1 + 4 c^2 x^2) x'' + 4 c^2 x x'^2 + 2 c g x = 0"],
    "bead_on_cycloid": ["s'' = -2 c g s"],
    "two_body": [
        "x1'' = G m2 (x2 - x1)/r12^3",
        "y1'' = G m2 (y2 - y1)/r12^3",
        "x2'' = G m1 (x1 - x2)/r12^3",
        "y2'' = G m1 (y1 - y2)/r12^3",
    ],
    "two_masses": [
        "m1 x1'' = -k (|x1 - x2| - l0) sgn(x1 - x2)",
        "m2 x2'' = k (|x1 - x2| - l0) sgn(x1 - x2) + F H(t)",
    ],
    "turntable": [
        "(I + m (d^2 + s^2)) theta'' + m d s'' + 2 m s theta' s' = 0",
        "d theta'' + s'' - s theta'^2 = 0",
    ],
    "car": [
        "m x'' = mu N (b theta' sin(theta) - x')/v - lambda sin(theta)",
        "m y'' = -mu N (y' + b theta' cos(theta))/v + lambda cos(theta)",
        "I theta'' = mu N b (x' sin(theta) - y' cos(theta) - b theta')/v + a_x lambda",
        "y'' cos(theta) - x'' sin(theta) + a_x theta'' - x' theta' cos(theta)"
        " - y' theta' sin(theta) = 0",
    ],
    "restricted_three_body": [
        "x'' = 2 y' + x - (1 - mu) (x + mu)/r1^3 - mu (x - 1 + mu)/r2^3",
        "y'' = -2 x' + y - (1 - mu) y/r1^3 - mu y/r2^3",
    ],
    "polar_particle": ["r'' - r theta'^2 = 0", "r theta'' + 2 r' theta' = 0"],
    "lorenz": ["x' = sigma (y - x)", "y' = x (rho - z) - y", "z' = x y - beta z"],
    "pendulum constrained": [
        "m x'' = lambda x/l",
        "m y'' + m g = lambda y/l",
        "x x'' + y y'' + x'^2 + y'^2 = 0",
    ],
    "one_skate": [
        "m x'' = -lambda sin(theta)",
        "m y'' = lambda cos(theta)",
        "theta'' = 0",
        "y'' cos(theta) - x'' sin(theta) - x' theta' cos(theta) - y' theta' sin(theta) = 0",
    ],
    "top by Euler angles": [
        "M11 = I3 cos^2(theta) + I1 sin^2(theta)",
        "M13 = I3 cos(theta)",
        "M22 = I1",
        "M33 = I3",
        "h1 = 2 (I3 - I1) phi' theta' cos(theta) sin(theta) + I3 theta' psi' sin(theta)",
        "h2 = (I1 - I3) phi'^2 cos(theta) sin(theta) - I3 phi' psi' sin(theta) + m g l sin(theta)",
        "h3 = I3 phi' theta' sin(theta)",
    ],
}


@pytest.mark.parametrize("name", TEXTBOOK)
def test_they_read_as_in_a_textbook(name):
    scene = ZOO[name].make() if name in ZOO else BESIDES[name]()
    assert [line.strip() for line in _motion(scene)] == TEXTBOOK[name]


def test_eulers_equations_of_a_body():
    lines = [line.strip() for line in _motion(scenes.free_body())]
    assert lines[:6] == [
        "x'' = 0",
        "y'' = 0",
        "z'' = 0",
        "I1 omega1' = (I2 - I3) omega2 omega3",
        "I2 omega2' = (I3 - I1) omega1 omega3",
        "I3 omega3' = (I1 - I2) omega1 omega2",
    ]


def test_a_chain_of_springs():
    system = FreePoints(m=[1.0, 2.0, 3.0], d=1)
    springs = (effects.Spring(10.0, i=0), effects.Spring(20.0, i=0, j=1))
    network = effects.SpringNetwork(((1, 2),), 30.0)
    scene = jaxdyn.Scene(system, (*springs, network), y0=[1.0, 0.0, 2.0, 0.0, 0.0, 0.0])
    assert [line.strip() for line in _motion(scene)] == [
        "m1 x1'' = k2 (x2 - x1) - k1 x1",
        "m2 x2'' = k2 (x1 - x2) + k3 (x3 - x2)",
        "m3 x3'' = k3 (x2 - x3)",
    ]


def test_springs_and_dashpots_between_two_points():
    hung = scenes.two_springs(c_a=0.2, c_b=0.3, c_d=0.1, anchor_a=(0.0, 0.0), anchor_b=(0.8, 0.6))
    assert _motion(hung)[0].strip() == (
        "m x'' = -c1 x (x x' + y y')/r1^2 - c2 (x - a_2x) ((x - a_2x) x' + (y - a_2y) y')/r2^2"
        " - c3 x' - k1 (r1 - l1) x/r1 - k2 (r2 - l2) (x - a_2x)/r2"
    )
    pair = scenes.two_body() + effects.Dashpot(0.3, i=0, j=1)
    assert _motion(pair)[0].strip() == (
        "m1 x1'' = c (x2 - x1) ((x1' - x2') (x1 - x2) + (y1' - y2') (y1 - y2))/r12^2"
        " + G m1 m2 (x2 - x1)/r12^3"
    )


def test_energies_and_constraints():
    found = jaxdyn.equations(BESIDES["squared length"]())
    assert found.text("constraints") == "Constraints\n  x^2 + y^2 = l^2"
    found = jaxdyn.equations(BESIDES["point masses on rods"]())
    assert found.text("constraints").splitlines()[1:] == [
        "  sqrt(x1^2 + y1^2) = l1",
        "  sqrt((x1 - x2)^2 + (y1 - y2)^2) = l2",
    ]
    found = jaxdyn.equations(scenes.two_springs())
    assert found.text("energies").splitlines()[1:] == [
        "  T = 1/2 m (x'^2 + y'^2)",
        "  V = 1/2 k1 (r1 - l1)^2 + 1/2 k2 (r2 - l2)^2 + m g y",
        "  E = T + V",
    ]
    assert found.text("lengths").splitlines()[1] == "  r1 = sqrt((x - a_1x)^2 + y^2)"
    found = jaxdyn.equations(scenes.bead_on_cycloid())
    assert found.text("energies").splitlines()[1:3] == ["  T = 1/2 m s'^2", "  V = c m g s^2"]


def test_latex_and_mathml():
    found = jaxdyn.equations(scenes.cart_pendulum())
    assert found.latex("motion").splitlines() == [
        r"\begin{aligned}",
        r"\left(m_1 + m_2\right) \ddot{x} + m_2 l \ddot{\theta} \cos \theta"
        r" - m_2 l \dot{\theta}^2 \sin \theta &= 0 \\",
        r"\ddot{x} \cos \theta + l \ddot{\theta} + g \sin \theta &= 0",
        r"\end{aligned}",
    ]
    assert found._repr_markdown_().count("$$") == 2 * len(found.sections)
    for name in ZOO:
        text = jaxdyn.equations(ZOO[name].make()).latex() if name in _SHORT else ""
        assert text.count("{") == text.count("}")


_SHORT = ("two_masses", "two_springs", "top", "plate", "one_skate", "power_law", "hill")


@pytest.mark.parametrize("name", _SHORT)
def test_mathml_is_well_formed(name):
    found = jaxdyn.equations(ZOO[name].make()).mathml()
    entities = {f"&{x};": "x" for x in GREEK}
    for entity, letter in entities.items():
        found = found.replace(entity, letter)
    root = ElementTree.fromstring(f"<div>{found}</div>")
    assert len(list(root.iter("math"))) == sum(
        len(section.lines) + len(section.notes)
        for section in jaxdyn.equations(ZOO[name].make()).sections
    )


def test_linearised_about_equilibria_against_derivatives():
    hanging = scenes.double_pendulum(m=(1.0, 2.0), length=(1.0, 0.5), g=9.81)
    upright = [np.pi, 0.0, 0.0, 0.0]
    for scene, y in ((hanging, np.zeros(4)), (hanging, upright), (scenes.cart_pendulum(), None)):
        found = jaxdyn.equations(scene).linearize(y)
        m, c, k = found.matrices()
        n = len(m)
        y = np.zeros(2 * n) if y is None else np.asarray(y)
        slopes = jax.jacfwd(lambda y, scene=scene: scene.rate(0.0, y))(jnp.asarray(y))
        below = np.hstack([-np.linalg.solve(m, k), -np.linalg.solve(m, c)])
        assert np.allclose(slopes[n:], below, rtol=1e-13, atol=1e-13)
    assert jaxdyn.equations(scenes.pendulum()).linearize().text() == "M = m l^2\nK = m g l"
    damped = jaxdyn.equations(scenes.oscillator() + effects.LinearDrag(0.1)).linearize()
    assert damped.text() == "M = m\nC = c\nK = k"
    assert "pmatrix" in damped.latex()
    assert damped.mathml().count("<math") == 3
    assert "at x = 0" in repr(damped)


@pytest.mark.slow
def test_a_linkage_near_its_equilibrium():
    crank = scenes.four_bar(**UNEQUAL, formulation="newton_euler")
    y = jaxdyn.equilibria(crank, [-1.0], [1.0]).states[0]
    found = jaxdyn.equations(crank)
    m, c, k = found.linearize(y).matrices()
    slopes = jax.jacfwd(lambda y: crank.rate(0.0, y))(jnp.asarray(y))
    assert np.allclose(slopes[1:], np.hstack([-k / m, -c / m]), rtol=1e-13, atol=1e-13)
    values = found.at(0.0, y)
    for left, right in found.equilibria().sections[0].lines:
        assert abs(left.value(values) - right.value(values)) < 1e-12


def test_linearised_refuses_what_is_no_equilibrium():
    found = jaxdyn.equations(scenes.pendulum())
    assert "a state at rest without accelerations" in refusal(lambda: found.linearize([1.0, 0.0]))
    assert "a state at rest" in refusal(lambda: found.linearize([0.0, 1.0]))
    shaken = jaxdyn.equations(scenes.shaken_pendulum())
    assert "equations that depend on time" in refusal(shaken.linearize)
    tied = jaxdyn.equations(scenes.pendulum(formulation="constrained"))
    assert "a scene of free coordinates" in refusal(tied.linearize)
    for name in ("two_body", "spring_mass", "power_law"):  # all points at the origin
        said = refusal(jaxdyn.equations(ZOO[name].make()).linearize)
        assert "a state at which the forces have derivatives" in said


#: Conditions of equilibrium, and a box that holds some.
RESTING = {
    "springs": (lambda: scenes.two_springs(), [-2.0] * 2, [2.0] * 2),
    "bars": (lambda: scenes.double_pendulum(), [-1.0] * 2, [4.0] * 2),
    "spring": (lambda: scenes.spring_mass(), [-2.0] * 2, [2.0] * 2),
    "rates": (lambda: scenes.lorenz(), [-10.0, -10.0, -1.0], [10.0, 10.0, 30.0]),
    "turning": (lambda: scenes.restricted_three_body(), [-1.5] * 2, [1.5] * 2),
}


@pytest.mark.sample("bars", "rates", "turning")
@pytest.mark.parametrize("name", RESTING)
def test_conditions_of_equilibrium_vanish_there_and_only_there(name):
    make, low, high = RESTING[name]
    scene = make()
    found = jaxdyn.equations(scene)
    lines = found.equilibria().sections[0].lines
    rng, free = np.random.default_rng(1), len(low)

    def sides(y):
        values = found.at(0.0, y)
        return np.array([[x.value(values) for x in line] for line in lines])

    states = jaxdyn.equilibria(scene, low, high).states
    assert len(states)
    for y in states:
        left, right = sides(y).T
        assert np.abs(left - right).max() <= 1e-12
    y = np.zeros(len(scene.y0))
    y[:free] = rng.uniform(low, high)
    left, right = sides(y).T
    assert np.abs(left - right).max() > 1e-3


def test_conditions_of_equilibrium_in_print():
    bars = jaxdyn.equations(scenes.double_pendulum()).equilibria()
    assert bars.text().splitlines() == ["Equilibria", "  sin(theta1) = 0", "  sin(theta2) = 0"]
    hung = jaxdyn.equations(scenes.spring_mass()).equilibria()
    assert hung.text().splitlines() == [
        "Equilibria",
        "  (r - l0) x/r = 0",
        "  k (r - l0) y/r + m g = 0",
        "with",
        "  r = sqrt(x^2 + y^2)",
    ]
    tied = jaxdyn.equations(scenes.pendulum(formulation="constrained")).equilibria()
    assert tied.text().splitlines() == [
        "Equilibria",
        "  lambda x = 0",
        "  m g = lambda y/l",
        "  sqrt(x^2 + y^2) = l",
        "Symbols",
        "  lambda: the force or the moment of each constraint, in their order",
    ]
    free = jaxdyn.equations(scenes.particle()).equilibria()
    assert free.text() == repr(free) == "Equilibria: every state at rest"
    everywhere = r"\text{Equilibria: every state at rest}"
    assert free.latex().splitlines() == [r"\begin{aligned}", everywhere, r"\end{aligned}"]


@pytest.mark.parametrize("name", ["shaken_pendulum", "cannonball", "ball_on_table", "car"])
def test_what_has_no_equilibrium_is_refused(name):
    said = refusal(jaxdyn.equations(ZOO[name].make()).equilibria)
    if name == "shaken_pendulum":
        assert "equilibria: expected equations without time" in said
    else:
        assert "equilibria: expected forces that have values at rest and can balance" in said


def test_symbols_that_a_reader_may_not_know_are_explained():
    pushed = jaxdyn.equations(scenes.two_masses())
    assert pushed.text("symbols").splitlines()[1:] == [
        "  sgn(u): the sign of u: 1, -1, or 0 where u = 0",
        "  H(u): the unit step: 0 where u < 0, and 1 from u = 0 on",
    ]
    assert r"\operatorname{H}\left(u\right) &: \text{the unit step" in pushed.latex("symbols")
    assert "<mi>H</mi>" in pushed.mathml("symbols")
    rolling = jaxdyn.equations(scenes.cylinder_on_ramp()).text("symbols")
    assert rolling.splitlines()[1:] == [
        "  N: normal force of the surface",
        "  F: friction, along the surface",
        "  E: the energy, which is constant",
    ]
    assert "unit quaternion" in jaxdyn.equations(scenes.top()).text("symbols")
    assert all(part.name != "symbols" for part in jaxdyn.equations(scenes.lorenz()).sections)


def test_squares_are_complete():
    lines = _motion(scenes.cylinder_on_cylinder())
    assert lines[3].strip() == "x x'' + y y'' = -(y x' - x y')^2/d^2"
    found = jaxdyn.equations(scenes.turntable())
    assert found.text("momenta").splitlines()[1:] == [
        "  p_theta = (I + m (d^2 + s^2)) theta' + m d s'"
    ]


def test_code_is_that_of_the_rate():
    found = jaxdyn.equations(scenes.lorenz())
    assert found.code("julia").startswith("function rate(t, y, p)")
    said = refusal(lambda: found.code("fortran"))
    assert "language" in said


def test_a_table_is_printed_by_its_pieces():
    table = jaxdyn.ode(lambda t, y: [jnp.interp(t, jnp.arange(3.0), jnp.array([1, 3, 2.0]))], [0.0])
    found = jaxdyn.equations(table)
    assert "1 if t < 0 else (1 + 2 t if t < 1 else (4 - t if t < 2 else" in found.text()
    assert "t < 1.0 ?" in found.code("javascript")


def test_what_cannot_be_printed_is_refused():
    loop = scenes.cannonball() + Winding()
    said = refusal(lambda: jaxdyn.equations(loop))
    assert "equations: expected a scene whose rate has formulas, got" in said
    assert "part" in refusal(lambda: jaxdyn.equations(scenes.pendulum()).text("forces"))

    def L(t, q, v):
        return 0.5 * v[0] ** 2 - jax.scipy.special.erf(q[0])

    odd = jaxdyn.lagrangian(L, [1.0], [0.0])
    said = refusal(lambda: jaxdyn.equations(odd))
    assert "functions whose derivative is known, got erf" in said


def test_values_that_are_held_between_times():
    times, values = jnp.array([1.0, 2.5]), jnp.array([0.5, 2.0, -1.0])
    held = jaxdyn.ode(lambda t, y: [values[jnp.searchsorted(times, t)] - y[0]], [0.0])
    (law,) = _motion(held)
    assert law.strip() == "y0' = (1/2 if t <= 1 else (2 if t <= 5/2 else -1)) - y0"


class Winding(Effect):
    """A force found by a loop of unknown length."""

    def force(self, t, r, v, m):
        return jax.lax.while_loop(lambda x: jnp.sum(x * x) > 1.0, lambda x: 0.5 * x, r)


def test_a_linkage_is_in_its_crank_angle():
    lines = _motion(scenes.four_bar(formulation="newton_euler"))
    assert [line.split()[0] for line in lines] == ["M", "h"]
    found = jaxdyn.equations(scenes.four_bar(formulation="newton_euler"))
    assert found.text("motion").splitlines()[0] == "Lagrange's equations: M theta1'' = h"
    assert found.text("lengths").splitlines()[1:5] == [
        "  kappa2 = -l1 sin(theta1 - theta3)/(l2 sin(theta2 - theta3))",
        "  kappa3 = l1 sin(theta1 - theta2)/(l3 sin(theta2 - theta3))",
        "  theta2' = kappa2 theta1'",
        "  theta3' = kappa3 theta1'",
    ]
    assert found.text("lengths").splitlines()[-1] == "  theta3'' = kappa3 theta1'' + sigma3"
    assert "jacobian" in refusal(found.jacobian)


def test_a_linkage_in_sympy():
    sympy = pytest.importorskip("sympy")
    scene = scenes.four_bar(**UNEQUAL, formulation="newton_euler")
    found, y = jaxdyn.equations(scene), np.asarray(scene.y0)
    (equation,) = found.sympy()
    t = sympy.Symbol("t")
    places = found.at(0.0, y)
    q = {name: sympy.Function(name)(t) for name in ("theta1", "theta2", "theta3")}
    values = {s: places[_named(places, s.name)] for s in equation.free_symbols if s != t}
    left, right = (
        side.subs(q["theta1"].diff(t, 2), float(scene.rate(0.0, y)[1]))
        .subs(q["theta1"].diff(t), y[1])
        .subs({x: places[_named(places, name)] for name, x in q.items()})
        .subs(values)
        for side in (equation.lhs, equation.rhs)
    )
    assert float(left) == pytest.approx(float(right), rel=1e-13)


def _named(values, name):
    return next(s for s in values if s.name == name)


@pytest.mark.slow
def test_equations_that_fill_books_are_refused():
    def L(t, q, v):
        return 0.5 * jnp.sum(v * v) - jnp.sum(q) ** 4 * jnp.sum(jnp.sin(q))

    said = refusal(lambda: jaxdyn.equations(jaxdyn.lagrangian(L, np.ones(9), np.zeros(9))))
    assert "equations: expected a scene whose equations fill some pages, got more than 500" in said


def test_own_equations():
    def hunt(t, y, p):
        prey, predators = y
        return [prey * (p["birth"] - predators), predators * (prey - 1.0)]

    scene = jaxdyn.ode(hunt, [2.0, 1.0], names=["prey", "predators"], params={"birth": 1.5})
    assert [line.strip() for line in _motion(scene)] == [
        "prey' = prey (birth - predators)",
        "predators' = predators (prey - 1)",
    ]
    assert r"\mathrm{prey}" in jaxdyn.equations(scene).latex()

    def L(t, q, v, p):
        return 0.5 * p["m"] * v[0] ** 2 - 0.25 * p["k"] * q[0] ** 4

    scene = jaxdyn.lagrangian(L, [2.0], [0.0], names=["x"], params={"m": 2.0, "k": 3.0})
    assert [line.strip() for line in _motion(scene)] == ["x'' = -(k/m) x^3"]


def test_zeros_are_left_out_and_values_are_shown():
    found = jaxdyn.equations(scenes.oscillator(k=2.5))
    assert found.text("parameters") == "Parameters\n  k = 2.5 N/m (stiffness)\n  m = 1 kg (mass)"
    assert {TEXT.symbol(s): x for s, x in found.parameters.items()} == {"k": 2.5, "m": 1.0}
    assert repr(found).startswith("Equations of oscillator\nNewton's law\n")


_GRAVITY = "g = 9.81 m/s^2 (acceleration of gravity)"
_DAMPED = ["c = 0.1 N m s (damping of the hinge)", "m = 1 kg (mass)", _GRAVITY, "l = 1 m (length)"]
_PAIR = ["G = 1 (gravitational constant)", "m1 = 2 (mass)", "m2 = 2 (mass)"]


@pytest.mark.parametrize(
    ("scene", "shown"),
    [
        (scenes.pendulum(damping=0.1), _DAMPED),
        (scenes.two_body(m1=2.0), _PAIR),
        (scenes.lorenz(), ["sigma = 10", "rho = 28", f"beta = {8 / 3:.15g}"]),
    ],
)
def test_parameters_are_said_to_be_what_they_are(scene, shown):
    _, *found = jaxdyn.equations(scene).text("parameters").splitlines()
    assert [line.strip() for line in found] == shown


def test_what_a_parameter_is_stands_behind_it_in_latex_and_mathml():
    found = jaxdyn.equations(scenes.cannonball(drag=0.5))
    assert r"g &= 9.81\ \text{m/s$^{2}$ (acceleration of gravity)}" in found.latex("parameters")
    assert "kg/m (drag coefficient)</mtext></math>" in found.mathml("parameters")
    days = scenes.n_body(units=("AU", "Msun", "day"))
    assert "AU^3/(Msun day^2) (gravitational constant)" in jaxdyn.equations(days).text("parameters")


def test_lagranges_method_of_sympy_gives_the_same():
    sympy = pytest.importorskip("sympy")
    mechanics = pytest.importorskip("sympy.physics.mechanics")
    t = sympy.Symbol("t")
    m, l, g = sympy.symbols("m1:3"), sympy.symbols("l1:3"), sympy.Symbol("g")  # noqa: E741
    q = [sympy.Function(f"theta{i}")(t) for i in (1, 2)]
    x = l[0] * sympy.sin(q[0]), l[0] * sympy.sin(q[0]) + l[1] * sympy.sin(q[1])
    y = -l[0] * sympy.cos(q[0]), -l[0] * sympy.cos(q[0]) - l[1] * sympy.cos(q[1])
    T = sum(m[i] * (x[i].diff(t) ** 2 + y[i].diff(t) ** 2) / 2 for i in (0, 1))
    V = sum(m[i] * g * y[i] for i in (0, 1))
    wanted = mechanics.LagrangesMethod(T - V, q).form_lagranges_equations()
    printed = jaxdyn.equations(scenes.double_pendulum(uniform=False)).sympy()
    for ours, theirs, factor in zip(printed, wanted, (l[0], m[1] * l[1]), strict=True):
        plain = {s: sympy.Symbol(s.name) for s in ours.free_symbols if s != t}
        gap = (factor * (ours.lhs - ours.rhs)).subs(plain) - theirs
        assert sympy.simplify(sympy.expand_trig(sympy.expand(gap))) == 0


def _by_kane(sympy, q, places, masses, weight):
    """Accelerations q'' of particles at places (x, y), by Kane's method; `weight` is g or 0."""
    mechanics = pytest.importorskip("sympy.physics.mechanics")
    t = mechanics.dynamicsymbols._t
    u = [sympy.Function(f"u{i}")(t) for i in range(len(q))]
    frame = mechanics.ReferenceFrame("N")
    origin = mechanics.Point("O")
    origin.set_vel(frame, 0)
    rates = dict(zip([x.diff(t) for x in q], u, strict=True))
    bodies, loads = [], []
    for i, ((x, y), m) in enumerate(zip(places, masses, strict=True)):
        point = mechanics.Point(f"P{i}")
        velocity = [part.diff(t).subs(rates) for part in (x, y)]
        point.set_vel(frame, velocity[0] * frame.x + velocity[1] * frame.y)
        bodies.append(mechanics.Particle(f"particle{i}", point, m))
        loads.append((point, -m * weight * frame.y))
    known = [x.diff(t) - v for x, v in zip(q, u, strict=True)]
    method = mechanics.KanesMethod(frame, q_ind=q, u_ind=u, kd_eqs=known)
    method.kanes_equations(bodies, loads)
    back = dict(zip(u, [x.diff(t) for x in q], strict=True))
    return list((method.mass_matrix.LUsolve(method.forcing)).subs(back))


def _cart(sympy, t):
    x, theta = (sympy.Function(name)(t) for name in ("x", "theta"))
    m, l, g = sympy.symbols("m1:3"), sympy.Symbol("l"), sympy.Symbol("g")  # noqa: E741
    mass = x + l * sympy.sin(theta), -l * sympy.cos(theta)
    return [x, theta], [(x, 0 * x), mass], m, g


def _bead(sympy, t):
    x = sympy.Function("x")(t)
    m, c, g = sympy.symbols("m c g")
    return [x], [(x, c * x**2)], [m], g


@pytest.mark.parametrize(
    ("name", "described"), [("cart_pendulum", _cart), ("bead_on_parabola", _bead)]
)
def test_kanes_method_of_sympy_gives_the_same(name, described):
    sympy = pytest.importorskip("sympy")
    t = sympy.Symbol("t")
    q, *rest = described(sympy, t)
    accelerations = _by_kane(sympy, q, *rest)
    found = dict(zip([x.diff(t, 2) for x in q], accelerations, strict=True))
    for ours in jaxdyn.equations(ZOO[name].make()).sympy():
        plain = {s: sympy.Symbol(s.name) for s in ours.free_symbols if s != t}
        gap = (ours.lhs - ours.rhs).subs(plain)
        assert gap.atoms(sympy.Derivative) & set(found)  # it is an equation for them
        assert sympy.simplify(gap.subs(found)) == 0


def test_sympy_has_the_functions_of_all_scenes():
    sympy = pytest.importorskip("sympy")
    for name in ("two_masses", "top", "power_law", "plate", "restricted_three_body"):
        for equation in jaxdyn.equations(ZOO[name].make()).sympy():
            assert isinstance(equation, sympy.Eq)


def test_sympy_is_optional(monkeypatch):
    monkeypatch.setitem(sys.modules, "sympy", None)
    said = refusal(jaxdyn.equations(scenes.pendulum()).sympy)
    assert said.endswith("Install it: pip install 'jaxdyn[equations]'.")


#: Scenes with coordinates that no energy depends on, and the names of these.
CYCLIC = {
    "cart_pendulum": (lambda: scenes.cart_pendulum(), ["x"]),
    "turntable": (lambda: scenes.turntable(), ["theta"]),
    "dumbbell": (lambda: scenes.dumbbell(formulation="lagrange"), ["x", "y", "theta"]),
    "top": (lambda: scenes.top(representation="euler"), ["phi", "psi"]),
    "bars": (lambda: scenes.double_pendulum(g=0.0, relative=True), ["phi1"]),
    "polar": (lambda: scenes.polar_particle() + effects.PowerLaw(2.0, -2.0), ["theta"]),
    "none": (lambda: scenes.pendulum(), []),
    "dragged": (lambda: scenes.cart_pendulum() + effects.LinearDrag(0.1), []),
}

#: Scenes of free points with the momenta that they conserve.
OF_POINTS = {
    "particle": (lambda: scenes.particle(), ["p_x", "p_y", "H_z"]),
    "cannonball": (lambda: scenes.cannonball(), ["p_x"]),
    "hanging_spring": (lambda: scenes.hanging_spring(), ["H_z"]),
    "power_law": (lambda: scenes.power_law(), ["H_z"]),
    "three_body": (lambda: scenes.three_body(), ["p_x", "p_y", "H_z"]),
    "n_body": (lambda: scenes.n_body(), ["p_x", "p_y", "p_z", "H_x", "H_y", "H_z"]),
    "dashpot": (BESIDES["dashpot of a pair"], ["p_x", "p_y", "H_z"]),
    "two_masses": (lambda: scenes.two_masses(), []),
    "drag": (BESIDES["quadratic drag"], []),
}


@pytest.mark.sample("dumbbell", "bars", "none", "three_body", "dashpot", "drag")
@pytest.mark.parametrize("name", [*CYCLIC, *OF_POINTS])
def test_momenta_in_print_are_conserved(name):
    if name in CYCLIC:
        make, coordinates = CYCLIC[name]
        names = [f"p_{q}" for q in coordinates]
    else:
        make, names = OF_POINTS[name]
    scene = make()
    found = jaxdyn.equations(scene)
    lines = [line for part in found.sections if part.name == "momenta" for line in part.lines]
    assert [TEXT.expression(line.left) for line in lines] == names
    motion = jaxdyn.simulate(scene, 1.0, samples=5, rtol=1e-13)
    for line in lines:
        values = [line.right.value(found.at(0.0, y)) for y in motion.ys]
        assert np.ptp(values) < 1e-12 * (1.0 + np.abs(values).max())


@pytest.mark.sample("lorenz", "pendulum", "polar_particle")
@pytest.mark.parametrize("name", ["lorenz", "pendulum", "two_body", "free_body", "polar_particle"])
def test_the_jacobian_is_the_derivative_of_the_rate(name):
    scene = ZOO[name].make()
    y = np.asarray(scene.y0) + 0.1
    found = jaxdyn.equations(scene)
    (values,) = found.jacobian().values(found.at(0.3, y))
    wanted = np.asarray(jax.jacfwd(lambda y: scene.rate(0.3, y))(jnp.asarray(y)))
    assert np.abs(values - wanted).max() <= 1e-13 * np.abs(wanted).max()


def test_the_jacobian_of_coupled_equations_is_refused():
    said = refusal(jaxdyn.equations(scenes.double_pendulum()).jacobian)
    assert "equations each with one derivative" in said
    tied = jaxdyn.equations(scenes.pendulum(formulation="constrained"))
    assert "jacobian" in refusal(tied.jacobian)


def test_a_jacobian_in_print():
    found = jaxdyn.equations(scenes.lorenz()).jacobian()
    assert found.text().splitlines() == [
        "J11 = -sigma",
        "J12 = sigma",
        "J21 = rho - z",
        "J22 = -1",
        "J23 = -x",
        "J31 = y",
        "J32 = x",
        "J33 = -beta",
    ]
    assert found._repr_markdown_().startswith("$$\nJ = \\begin{pmatrix} -\\sigma & \\sigma & 0")
    sprung = jaxdyn.equations(scenes.spring_mass()).jacobian()
    assert sprung.text().splitlines()[2:4] == [
        "J31 = (k/m) (l0/r - 1 - l0 x^2/r^3)",
        "J32 = -k l0 x y/(m r^3)",
    ]
    assert sprung.text().splitlines()[-2:] == ["with", "r = sqrt(x^2 + y^2)"]
    assert sprung.latex().endswith(r"\qquad r = \sqrt{x^2 + y^2}")
    # With ten columns or more, the two numbers of an entry are apart.
    assert jaxdyn.equations(scenes.box()).jacobian().text().splitlines()[2] == "J3,10 = 1"


#: Mechanisms whose forces of constraints follow from one body after the other.
HELD = {
    "pendulum": lambda: scenes.pendulum(m=2.0, length=1.5, rate=0.7),
    "drag on a pendulum": lambda: scenes.pendulum(rate=0.7) + effects.LinearDrag(0.3),
    "bead_on_parabola": lambda: scenes.bead_on_parabola(c=0.7, m=1.3, speed=0.4),
    "cart_pendulum": lambda: scenes.cart_pendulum(m=(2.0, 1.3), length=0.8, rate=0.5),
    "two point masses": lambda: scenes.double_pendulum(
        m=(2.0, 1.3), length=(0.8, 1.2), uniform=False, rates=(0.4, -0.7)
    ),
    "turntable": lambda: scenes.turntable(m=1.3, d=0.4),
    "shaken_pendulum": lambda: scenes.shaken_pendulum(m=1.3),
}


@pytest.mark.sample("pendulum", "two point masses")
@pytest.mark.parametrize("name", HELD)
def test_forces_of_constraints_are_those_of_bodies_cut_free(name):
    scene = HELD[name]()
    found = jaxdyn.equations(scene)
    (part,) = (part for part in found.sections if part.name == "reactions")
    t, y = 0.3, np.asarray(scene.y0) + 0.1
    values = found.at(t, y)
    slopes = dict(zip((x for x, _ in scene.labels()), np.asarray(scene.rate(t, y)), strict=True))
    # A formula may contain accelerations, and forces in joints further out.
    for _ in part.lines:
        for line in part.lines:
            for s in line.right.symbols():
                if s.kind == "acceleration":
                    values[s] = slopes[f"{s.name.rstrip(chr(39))}_dot"]
            if line.right.symbols() <= values.keys():
                (symbol,) = line.left.symbols()
                values[symbol] = line.right.value(values)
    sizes = iter([values[s] for line in part.lines for s in line.left.symbols()])
    bodies = free_body(scene, t, y)
    for joint in scene.system.joints(jnp.asarray(t), jnp.asarray(y)):
        way = 1 if joint.other is None else -1
        wanted = sum(way * next(sizes) * row for row in np.asarray(joint.directions))
        (force,) = (
            f.force
            for f in bodies.bodies[joint.on].forces
            if f.name == joint.name and np.allclose(f.at, joint.at)
        )
        np.testing.assert_allclose(wanted, force, rtol=0, atol=1e-12 * bodies.largest)
    assert list(sizes) == []


@pytest.mark.parametrize(
    ("scene", "lines"),
    [
        (lambda: scenes.pendulum(), ["R = m (l theta'^2 + g cos(theta))"]),
        (
            lambda: scenes.cart_pendulum(),
            ["R1 = m2 (-x'' sin(theta) + l theta'^2 + g cos(theta))", "R2 = R1 cos(theta) + m1 g"],
        ),
    ],
)
def test_forces_of_constraints_in_print(scene, lines):
    found = jaxdyn.equations(scene()).text("reactions").splitlines()[1:]
    assert [line.strip() for line in found] == lines


@pytest.mark.sample("pendulum")
@pytest.mark.parametrize(
    "make",
    [
        lambda: scenes.pendulum(m=2.0, length=1.5, formulation="constrained", rate=0.4),
        lambda: scenes.bead_on_parabola(formulation="constrained", c=0.7, m=1.3, speed=0.4),
        lambda: scenes.rod_on_line(),
        lambda: scenes.dumbbell(),
    ],
    ids=["pendulum", "bead", "rod", "dumbbell"],
)
def test_a_single_multiplier_has_a_formula(make):
    scene = make()
    found = jaxdyn.equations(scene)
    (part,) = (part for part in found.sections if part.name == "reactions")
    (line,) = part.lines
    motion = jaxdyn.simulate(scene, 0.3, samples=3)
    wanted = constraints.multipliers(motion)[:, 0]
    values = [line.right.value(found.at(t, y)) for t, y in zip(motion.ts, motion.ys, strict=True)]
    np.testing.assert_allclose(values, wanted, rtol=1e-9, atol=1e-12)


def test_where_forces_of_constraints_have_no_short_formula_there_is_none():
    damped = scenes.pendulum(damping=0.3)
    for scene in (scenes.double_pendulum(), scenes.four_bar(), scenes.spring_mass(), damped):
        assert all(part.name != "reactions" for part in jaxdyn.equations(scene).sections)


#: A prescribed motion, whose energy does not follow from equations.
UNSHOWN = {"turned_box"}


@pytest.mark.sample("pendulum", "spring_mass", "two_masses", "top", "lorenz")
@pytest.mark.parametrize("name", ZOO)
def test_the_energy_is_said_to_be_constant_exactly_where_it_is(name):
    scene = ZOO[name].make()
    said = "E: the energy, which is constant" in str(jaxdyn.equations(scene))
    if not scene.has_energy:
        assert not said
        return
    rng = np.random.default_rng(0)
    slopes = []
    for _ in range(STATES):
        y = scene.y0 + 0.1 * rng.standard_normal(len(scene.y0))
        y = scene.system.project(jnp.asarray(0.2), y)

        def whole(t, y):
            return sum(scene.system.energies(t, y, scene.effects))

        t = jnp.asarray(0.2)
        _, slope = jax.jvp(whole, (t, y), (jnp.ones(()), scene.rate(t, y)))
        size = sum(abs(x) for x in scene.system.energies(t, y, scene.effects))
        slopes.append(float(abs(slope)) / (1e-300 + float(size)))
    constant = max(slopes) < 1e-8
    assert said == (constant and name not in UNSHOWN), slopes


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: scenes.free_body(), ["p_x", "p_y", "p_z", "H_x", "H_y", "H_z"]),
        (
            lambda: scenes.free_body(representation="matrix"),
            ["p_x", "p_y", "p_z", "H_x", "H_y", "H_z"],
        ),
        (lambda: scenes.top(), ["H_z", "H3"]),
        (lambda: scenes.box(), ["H_x", "H_y", "H_z"]),
    ],
    ids=["free", "matrix", "top", "box"],
)
def test_momenta_of_a_body_in_fixed_axes_are_conserved(make, names):
    scene = make()
    found = jaxdyn.equations(scene)
    lines = [line for part in found.sections if part.name == "momenta" for line in part.lines]
    shown = [TEXT.expression(line.left) for line in lines]
    assert [x for x in shown if x in names] == names
    motion = jaxdyn.simulate(scene, 0.1 * float(scene.t1), samples=5, rtol=1e-13)
    for line in lines:
        values = [line.right.value(found.at(0.0, y)) for y in motion.ys]
        assert np.ptp(values) < 1e-11 * (1e-3 + np.abs(values).max())
    assert "angular momentum about the" in found.text("symbols")


def test_a_driven_frame_has_jacobis_integral_and_no_constant_energy():
    def kinetic(t, q, v, p):  # of a bead on a hoop that is turned about its diameter
        return 0.5 * p["m"] * (v[0] ** 2 + p["w"] ** 2 * jnp.sin(q[0]) ** 2)

    def potential(t, q, p):
        return -p["m"] * p["g"] * jnp.cos(q[0])

    numbers = {"m": 1.0, "w": 2.0, "g": 9.81}
    turned = jaxdyn.lagrangian((kinetic, potential), [0.3], [0.1], params=numbers)
    text = str(jaxdyn.equations(turned))
    assert "h: Jacobi's integral, which is constant" in text
    assert "the energy" not in text


def test_no_name_stands_for_two_things():
    def L(t, q, v, p):
        return 0.5 * p["m"] * v[0] ** 2 - 0.5 * p["E"] * q[0] ** 2

    text = str(jaxdyn.equations(jaxdyn.lagrangian(L, [0.3], [0.1], params={"m": 1.0, "E": 3.0})))
    assert "E q0^2" in text
    assert "E = " not in text.split("Parameters")[0]


@pytest.mark.parametrize("make", [list, np.array, jnp.array])
def test_numbers_in_lists_are_counted_as_in_python(make):
    def rate(t, y, p):
        return [y[1], -p["k"][0] * y[0] - p["k"][1] * y[0] ** 3 - p["c"] * y[1]]

    params = {"k": make([4.0, 0.1]), "c": 0.2}
    scene = jaxdyn.ode(rate, [1.0, 0.0], names=["x", "v"], params=params)
    found = str(jaxdyn.equations(scene))
    assert "x'' = -c x' - k1 x^3 - k0 x\n" in found
    assert "k0 = 4\n" in found
    scene = jaxdyn.ode(
        lambda t, y, p: [p[0] * y[1], p[1][1] * y[0]], [1.0, 0.0], params=[2.0, [3.0, 5.0]]
    )
    assert "params1,1 = 5" in str(jaxdyn.equations(scene))
