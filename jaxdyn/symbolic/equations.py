"""`jaxdyn.equations`: the equations of motion of a scene as a textbook prints them."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxdyn import _checks
from jaxdyn._doors import renamed
from jaxdyn.scene import Scene, check_scene
from jaxdyn.symbolic.algebra import (
    ONE,
    Atom,
    Expression,
    Group,
    Symbol,
    as_expression,
    number,
    total,
)
from jaxdyn.symbolic.arranging import (
    Lengths,
    clear_denominators,
    collect,
    complete_squares,
    drop_steady_factors,
    factor_common,
    of_energy,
    of_momentum,
    of_points,
    shared_factor,
    split_common,
)
from jaxdyn.symbolic.code import code
from jaxdyn.symbolic.deriving import derive
from jaxdyn.symbolic.impacts import impacts
from jaxdyn.symbolic.linear import Linear, jacobian
from jaxdyn.symbolic.matrices import Matrices, index_of
from jaxdyn.symbolic.sections import Line, Note, Printed, Section, functions_in
from jaxdyn.symbolic.to_sympy import ToSympy

#: From this many coordinates on, a mass matrix that is not diagonal is shown by its entries.
_MATRIX_FROM = 3


class _Row(NamedTuple):
    """The content of a printed equation: the sum of coefficients times unknowns equals `rest`."""

    coefficients: dict[Symbol, Expression]
    rest: Expression


@renamed(linearised="linearize")
class Equations(Printed):
    """The equations of motion of a scene, with its parameters as symbols; see `equations`.

    Attributes:
      scene: the scene.
      sections: "motion", "impacts", "constraints", "lengths" (names for lengths and ratios),
        "reactions" (forces of constraints that have short formulas), "energies", "momenta",
        "symbols" (meanings of symbols and functions) and "parameters".
      parameters: the symbols of parameters in print, and their values in the scene.
    """

    scene: Scene
    parameters: dict[Symbol, float]

    def __init__(self, scene: Scene):
        self.scene = scene
        self._derived = found = derive(scene)
        places, speeds = found.conditions
        sums = (*found.equations, *found.forces, *places, *speeds)
        sums += (*found.energies.values(), *found.conserved.values())
        known = found.symbols.values | found.values
        self._lengths = short = Lengths(sums, (*found.symbols.state, *known))
        self._rows: list[_Row] = []
        conditions = [_condition(short(x)) for x in (*places, *speeds)]
        definitions = [Line(as_expression(s), collect(x)) for s, x in self._follower_derivatives]
        definitions += self._follower_accelerations()
        definitions += [Line(as_expression(s), x) for s, x in short.definitions]
        energies = [
            Line(_named(name), of_energy(complete_squares(short(x))))
            for name, x in found.energies.items()
        ]
        hits = self._impacts()
        lines, constant = self._constant_energy(" between impacts" if hits.lines else "")
        energies += lines
        reactions = [
            Line(as_expression(one.symbol), factor_common(short(one.value)))
            for one in found.reactions
        ]
        momenta = [
            Line(_named(*name.split("_", 1)), (of_points if found.alone else of_momentum)(short(x)))
            for name, x in found.conserved.items()
        ]
        sections = [
            self._motion(),
            hits,
            Section("constraints", "Constraints", tuple(conditions)),
            Section("lengths", "with", tuple(definitions)),
            Section("reactions", "Forces of constraints", tuple(reactions)),
            Section("energies", "Energies", tuple(energies)),
            Section("momenta", "Conserved momenta", tuple(momenta)),
        ]
        lines = [line for part in sections for line in part.lines]
        notes = (*functions_in(lines), *found.notes)
        notes += constant
        if not found.multipliers:
            notes += tuple(Note(as_expression(one.symbol), one.meaning) for one in found.reactions)
        sections.append(Section("symbols", "Symbols", notes=notes))
        used = {s for part in sections for line in part.lines for x in line for s in x.symbols()}
        in_order = sorted(used & known.keys(), key=lambda s: s.key)
        self.parameters = {s: known[s] for s in in_order}
        values = [Line(as_expression(s), Expression({(): known[s]})) for s in in_order]
        described = found.symbols.described
        remarks = tuple(_remark(*described.get(s, ("", ""))) for s in in_order)
        sections.append(Section("parameters", "Parameters", tuple(values), remarks=remarks))
        super().__init__(part for part in sections if part.lines or part.notes)

    def _constant_energy(self, when: str) -> tuple[list[Line], tuple[Note, ...]]:
        """T + V if it is constant, or Jacobi's integral; and the note that says so."""
        found, of = self._derived, self._derived.energies
        taken = {s.name for s in (*found.symbols.state, *found.symbols.values, *found.values)}
        if found.constant_energy is None or not of or taken & {"E", "h"}:
            return [], ()
        constant = (Note(_named("E"), f"the energy, which is constant{when}"),)
        if "E" in of:
            return [], constant
        if of.keys() == {"T", "V"} and not (found.constant_energy - of["T"] - of["V"]).expand():
            return [Line(_named("E"), _named("T") + _named("V"))], constant
        constant = (Note(_named("h"), "Jacobi's integral, which is constant"),)
        return [Line(_named("h"), of_energy(self._lengths(found.constant_energy)))], constant

    def _motion(self) -> Section:
        found = self._derived
        n = len(found.symbols.unknowns)
        laws, conditions = found.equations[:n], found.equations[n:]
        mass = [[x.differentiate(s) for s in found.symbols.unknowns] for x in laws]
        coupled = any(mass[i][j] for i in range(n) for j in range(n) if i != j)
        law = found.law
        if found.followers or (coupled and n >= _MATRIX_FROM and not found.alone):
            if n == 1:
                law = f"{law}: M {found.symbols.unknowns[0].name} = h"
            else:
                reactions = " + G^T lambda" if found.multipliers else ""
                law = f"{law}: M q'' = h{reactions}, M symmetric; entries that are not here are 0"
            lines = self._entries(laws, mass)
        else:
            forces = (*found.forces, *(number(0),) * (n - len(found.forces)))
            lines = [self._line(x, force) for x, force in zip(laws, forces, strict=True)]
        lines += [self._line(x, number(0)) for x in conditions]
        return Section("motion", law, tuple(lines))

    def _impacts(self) -> Section:
        lines, short = [], self._lengths
        for where, after in impacts(self.scene, self._derived.symbols):
            lines.append(_condition(short(where)))
            lines += [Line(as_expression(s), collect(short(x))) for s, x in after.items()]
        return Section("impacts", "Impacts: the place, and the state just after (+)", tuple(lines))

    def _line(self, whole: Expression, force: Expression) -> Line:
        """One equation: terms of the motion on the left, forces without potential on the right."""
        found = self._derived
        whole, force = self._lengths(whole), self._lengths(force)
        parts = {s: whole.differentiate(s) for s in self._unknowns}
        rates = [s for s in found.symbols.unknowns if parts[s]]
        inertial = total(parts[s] * as_expression(s) for s in rates)
        reactions = total(parts[s] * as_expression(s) for s in found.multipliers)
        shared = _divisor(whole, whole - inertial if rates else whole)
        if reactions:  # each term stays a force, or a moment
            shared = number(1)
        single = len(found.symbols.unknowns) == 1 and not found.multipliers and not found.solved
        if single and len(parts[rates[0]].terms) == 1:
            shared = parts[rates[0]]
        whole, force, inertial, reactions = (
            x / shared for x in (whole, force, inertial, reactions)
        )
        alone = found.alone or (single and len(inertial.terms) == 1)
        if rates:
            left = inertial if alone else whole - reactions + force
            right = left - whole
        else:
            left, right = whole, number(0)
        line = _positive(collect(left), collect(right))
        if found.kinematic and len(line.right.terms) > 1 and not _is_physical(line.right):
            content, _, inner = split_common(line.right)
            line = Line(line.left, Expression({((Group(inner), ONE),): content}))
        self._rows.append(self._read(line))
        return line

    def _read(self, line: Line) -> _Row:
        """The equation of a line, solved for the part with unknowns."""
        unknowns: dict[Atom, Expression] = dict.fromkeys(self._unknowns, number(0))
        slopes = {
            s: line.left.differentiate(s) - line.right.differentiate(s) for s in self._unknowns
        }
        rest = (line.right - line.left).replace(unknowns.get)
        return _Row({s: x for s, x in slopes.items() if x}, rest)

    def _entries(self, laws: Sequence[Expression], mass: list) -> list[Line]:
        """The entries of M, h and G in M q'' = h + G^T lambda."""
        found, short = self._derived, self._lengths
        unknowns, n = found.symbols.unknowns, len(laws)
        nothing: dict[Atom, Expression] = dict.fromkeys(self._unknowns, number(0))
        m = [[factor_common(short(x)) for x in row] for row in mass]
        h = [collect(short(-x.replace(nothing.get))) for x in laws]
        g = [[factor_common(short(-x.differentiate(s))) for x in laws] for s in found.multipliers]
        places = range(n)

        def entry(stem: str, *of: int) -> Expression:
            return _named(stem, index_of(n, *of) if n > 1 else "")

        lines = [Line(entry("M", i, j), m[i][j]) for i in places for j in range(i, n)]
        lines += [Line(entry("h", i), h[i]) for i in places]
        lines += [Line(entry("G", k, i), x) for k, row in enumerate(g) for i, x in enumerate(row)]
        for i in range(n):
            reactions = {s: -row[i] for s, row in zip(found.multipliers, g, strict=True)}
            self._rows.append(_Row(dict(zip(unknowns, m[i], strict=True)) | reactions, h[i]))
        return [line for line in lines if line.right]

    @property
    def _unknowns(self) -> tuple[Symbol, ...]:
        return (*self._derived.symbols.unknowns, *self._derived.multipliers)

    @property
    def _follower_derivatives(self) -> tuple[tuple[Symbol, Expression], ...]:
        """The expressions for the derivatives of coordinates that follow from others."""
        followers = self._derived.followers
        return followers.definitions if followers else ()

    def _follower_accelerations(self) -> list[Line]:
        """The accelerations of coordinates that follow from others."""
        found = self._derived.followers
        return [Line(as_expression(a), x) for a, x in found.accelerations] if found else []

    def equilibria(self) -> Printed:
        """The conditions of equilibrium: equations for the coordinates and the multipliers.

        `jaxdyn.equilibria` finds the states that satisfy them. Conditions that always hold at rest
        are left out, and so are factors that are never 0, such as masses.

        Raises:
          ValueError: the equations depend on time; a motion is steady or a fall, without
            equilibrium; or a force has no value at rest, such as dry friction.
        """
        found, short = self._derived, self._lengths
        at_rest = self._at_rest()
        if any(found.symbols.time in x.symbols() for x in found.equations):
            remedy = "jaxdyn.equilibria(scene, low, high, t=...) freezes a scene at a time."
            raise _checks.fail("equilibria", "equations without time", "some with it", remedy)
        laws = [x.replace(at_rest.get) for x in found.equations[: len(found.symbols.unknowns)]]
        lines = [self._condition_of_rest(short(x)) for x in laws if x]
        steady = any(_is_parameter(x.left) and _is_parameter(x.right) for x in lines)
        if steady or not all(math.isfinite(c) for x in laws for c in x.terms.values()):
            raise _checks.fail(
                "equilibria",
                "forces that have values at rest and can balance",
                "a constant one, or one that has no value there",
                "A phase that runs, a free fall and dry friction have no conditions of rest.",
            )
        lines += [_condition(short(x)) for x in found.conditions[0]]
        lines = list(dict.fromkeys(lines))
        used = {s for line in lines for x in line for s in x.symbols()}
        definitions = [
            Line(as_expression(s), collect(x))
            for s, x in (*self._follower_derivatives, *short.definitions)
            if s in used
        ]
        title = "Equilibria" if lines else "Equilibria: every state at rest"
        parts = [Section("equilibria", title, tuple(lines))]
        notes = (*functions_in(lines), *found.notes)
        stems = {s.stem for s in used}
        notes = tuple(n for n in notes if any(s.stem in stems for s in n.symbol.symbols()))
        more = [
            Section("lengths", "with", tuple(definitions)),
            Section("symbols", "Symbols", notes=notes),
        ]
        return Printed([*parts, *(part for part in more if part.lines or part.notes)])

    def _condition_of_rest(self, whole: Expression) -> Line:
        """A law at rest: loads on the left, constraint forces on the right."""
        slopes = ((s, whole.differentiate(s)) for s in self._derived.multipliers)
        reactions = total(x * as_expression(s) for s, x in slopes)
        left, right = collect(whole - reactions), collect(-reactions)
        line = _positive(left, right) if left else _positive(right, left)
        return Line(*drop_steady_factors(line))

    def _at_rest(self) -> dict[Atom, Expression]:
        """Everything that is 0 at rest: velocities, derivatives, and expressions of these."""
        found = self._derived
        moving = {"velocity", "acceleration", "rate"}
        named = (
            *found.symbols.state,
            *found.symbols.rates,
            *(s for s, _ in self._follower_derivatives),
        )
        zeros: dict[Atom, Expression] = {s: number(0) for s in named if s.kind in moving}
        for s, x in self._follower_derivatives:
            if not x.replace(zeros.get):
                zeros[s] = number(0)
        return zeros

    @property
    def _values(self) -> dict[Symbol, float]:
        return self._derived.symbols.values | self._derived.values

    def at(self, t: float, y: Sequence[float]) -> dict[Symbol, Any]:
        """The values of all symbols at a state, except derivatives that it does not contain.

        With these, ``line.right.value(values)`` evaluates a printed expression.

        Args:
          t: () time.
          y: (k,) state.
        """
        state = np.asarray(_checks.array("y", y, np.shape(self.scene.y0)))
        found = self._derived.symbols
        values: dict[Symbol, Any] = {**self._values, found.time: float(t)}
        values |= dict(zip(found.state, state.tolist(), strict=True))
        followers = self._derived.followers
        values |= followers.values(t, state) if followers else {}
        for s, x in (*self._follower_derivatives, *self._lengths.definitions):
            values[s] = x.value(values)
        return values

    def rate(self, t: float, y: Sequence[float]) -> np.ndarray:
        """(k,) the rate from the printed equations, which are solved for the derivatives.

        It equals that of the scene to rounding, but is slow; it serves to check the equations.

        Args:
          t: () time.
          y: (k,) a state, on the constraints if there are any; a quaternion has length 1.
        """
        found, unknowns = self._derived.symbols, self._unknowns
        values = self.at(t, y)
        matrix = np.zeros((len(self._rows), len(unknowns)))
        for i, row in enumerate(self._rows):
            for s, x in row.coefficients.items():
                matrix[i, unknowns.index(s)] = x.value(values)
        rest = np.array([row.rest.value(values) for row in self._rows])
        scale = np.abs(matrix).max(axis=1, keepdims=True)
        # If multipliers are not determined, those of least norm are taken.
        matrix, rest = matrix / scale, rest / scale[:, 0]
        solution = np.zeros(len(unknowns))
        # Forces and accelerations differ in size; the second solve removes the rounding by that.
        for _ in range(2):
            solution += np.linalg.lstsq(matrix, rest - matrix @ solution, rcond=_RANK)[0]
        values |= dict(zip(unknowns, solution.tolist(), strict=True))
        return np.array([values[s] for s in found.rates])

    def sympy(self) -> list[Any]:
        """The equations of motion as equations of SymPy, with coordinates as functions of t.

        If they are printed as the entries of matrices, these are the rows of M q'' = h.

        Raises:
          ValueError: SymPy is not installed, or has no such function.
        """
        found = self._derived
        made = ToSympy(
            found.symbols, dict((*self._follower_derivatives, *self._lengths.definitions))
        )
        return [
            made.equation(
                total(x * as_expression(s) for s, x in row.coefficients.items()), row.rest
            )
            for row in self._rows
        ]

    def code(self, language: str) -> str:
        """The source of the rate as a function (t, y, p) in a language.

        Args:
          language: "python", "numpy", "javascript", "c" or "julia".
        Raises:
          ValueError: there is no such language, or it does not have a function of the rate.
        """
        return code(self.scene, language)

    def linearize(self, y: Sequence[float] | None = None) -> Linear:
        """The equations near an equilibrium: M x'' + C x' + K x = 0 with symbols as entries.

        Args:
          y: (k,) an equilibrium; by default the state of zeros.
        Raises:
          ValueError: `y` is not an equilibrium, or the scene has constraints or depends on time.
        """
        zeros = np.zeros(np.shape(self.scene.y0))
        at = np.asarray(_checks.array("y", zeros if y is None else y, zeros.shape))
        return Linear(self._derived, at, self._values)

    def jacobian(self) -> Matrices:
        """The derivatives J of the rate with respect to the state, with symbols as entries.

        Raises:
          ValueError: some equation contains more than one highest derivative; the Jacobian would be
            too long to read.
        """
        return jacobian(self._derived, self._lengths)

    def __repr__(self) -> str:
        name = f" of {self.scene.name}" if self.scene.name else ""
        return f"Equations{name}\n{self.text()}"


#: Smallest singular value of independent conditions.
_RANK = 1e-12


def equations(scene: Scene) -> Equations:
    """The equations of motion of a scene as in a textbook, with symbols for its parameters.

    Free points obey Newton's law, mechanisms Lagrange's equations, with multipliers for constraints
    and rolling conditions, rigid bodies Euler's equations; the equations of other systems are their
    rates. The constraints, their forces, the energies, whether their sum is constant, the conserved
    momenta and the values of the symbols are printed as well.

    Terms with a parameter that is 0 in the scene are left out. Isolated points where a formula is
    undefined, such as the direction of a spring of length 0, are ignored. Quaternions have length
    1, and the distance of the ends of a rod is written as its length. Numerical stabilisation of
    constraints is not shown. Where impacts end a phase of a motion, their law is printed, and the
    equations are those between impacts.

    Args:
      scene: any that has formulas.
    Returns:
      `Equations`: `text()`, `latex()`, `mathml()`, `sympy()`, `code(language)`, `equilibria()`,
      `linearize()`, `jacobian()`.
    Raises:
      ValueError: the scene is invalid, or its rate contains something without formulas: a loop of
        unknown length, a callback, a function without a known derivative in an energy.
    Limits: the equations of many hinged bars fill pages. Forces of constraints have formulas where
      they follow from Newton's law for one body after the other, or there is a single multiplier;
      several multipliers are unknowns of the equations.
    Example:
      >>> import jaxdyn
      >>> from jaxdyn import scenes
      >>> found = jaxdyn.equations(scenes.cart_pendulum())
      >>> print(found.text("motion"))
      Lagrange's equations
        (m1 + m2) x'' + m2 l theta'' cos(theta) - m2 l theta'^2 sin(theta) = 0
        x'' cos(theta) + l theta'' + g sin(theta) = 0
    """
    return Equations(check_scene(scene))


def _remark(unit: str, meaning: str) -> str:
    """The unit of a parameter and its meaning, which follow its value."""
    return f"{unit} {f'({meaning})' if meaning else ''}".strip()


def _divisor(whole: Expression, others: Expression) -> Expression:
    """The common factor of an equation, and the common denominator of the other terms."""
    shared = shared_factor([whole])
    if len(others.terms) > 1:
        for m in shared_factor([others / shared]).terms:
            for a, e in m:
                if e < 0 and isinstance(a, Symbol) and a.kind == "parameter":
                    shared = shared * as_expression(a) ** e
    return shared


def _condition(x: Expression) -> Line:
    """A constraint: coordinates on the left, lengths on the right."""
    x = clear_denominators(x)
    fixed = {m: -c for m, c in x.terms.items() if _is_parameter(Expression({m: c}))}
    right = Expression(fixed)
    return _positive(collect(x + right), collect(right))


def _positive(left: Expression, right: Expression) -> Line:
    negative = left and all(c < 0 for c in left.terms.values())
    return Line(-left, -right) if negative else Line(left, right)


def _is_parameter(x: Expression) -> bool:
    return all(s.kind == "parameter" for s in x.symbols())


def _is_physical(x: Expression) -> bool:
    """Whether it contains parameters."""
    return any(s.kind == "parameter" for s in x.symbols())


def _named(stem: str, index: str = "") -> Expression:
    return as_expression(Symbol(stem + index, "short", stem=stem, index=index))
