"""The equations of motion of each kind of system, derived as on paper.

Free points obey Newton's law, mechanisms Lagrange's equations, with multipliers for their
constraints, and rigid bodies Newton's law and Euler's equations. Other systems are given by their
rates, which are printed as they are.

An equation is a sum that is zero. It is linear in the derivatives and in the multipliers, so that
`equations` can solve the printed equations and compare the result with the rate.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn.effects import UniformGravity
from jaxdyn.formulations.attitude import Quaternion
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.formulations.lagrange import Lagrange, Lagrangian
from jaxdyn.formulations.linear import LinearSystem
from jaxdyn.formulations.mechanism import (
    Mechanism,
    MechanismSystem,
    on_coordinates,
    positions_and_velocities,
    pull_back,
)
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.formulations.newton_euler import NewtonEuler
from jaxdyn.formulations.polar import PolarParticle, polar_basis
from jaxdyn.formulations.prescribed import Prescribed
from jaxdyn.formulations.rigid import RigidBody, inertia_matrix
from jaxdyn.geometry.inertia import MaterialPoints
from jaxdyn.mechanisms.cylinders import SLIPS, Cylinder
from jaxdyn.mechanisms.euler_body import EulerBody
from jaxdyn.mechanisms.skates import LagrangeSkates
from jaxdyn.scene import Scene
from jaxdyn.solvers.formulas.formulas import objects
from jaxdyn.symbolic.algebra import (
    Coefficient,
    Expression,
    Group,
    Monomial,
    Symbol,
    as_expression,
    number,
    total,
)
from jaxdyn.symbolic.arranging import clear_denominators
from jaxdyn.symbolic.following import (
    Followers,
    eliminate_followers,
    find_followers,
    opened_coordinates,
)
from jaxdyn.symbolic.reactions import Reaction, only_multiplier, reactions_of
from jaxdyn.symbolic.reading import read
from jaxdyn.symbolic.sections import Note
from jaxdyn.symbolic.simplifying import simplify
from jaxdyn.symbolic.symbols import Symbols, halves, symbols
from jaxdyn.system import potential_energy, total_force

#: Systems whose equations are Lagrange's.
_BY_LAGRANGE = (NewtonEuler, Lagrange, Lagrangian, LinearSystem, Constrained, LagrangeSkates)


class DerivedEquations(NamedTuple):
    """The equations of motion of a scene, before they are arranged.

    Attributes:
      symbols: the symbols of the scene.
      law: the name of the equations.
      equations: sums that are zero, linear in the unknown derivatives and multipliers.
      multipliers: the symbols of the multipliers.
      forces: the parts of the first equations that are forces without a potential; these are
        printed on the right-hand side.
      energies: T and V, or L, by name, where there are any.
      constant_energy: the energy as a sum if it is constant; None if not, or if that is unknown.
      conserved: conserved momenta by name, "p_x" or "H_z".
      reactions: forces of constraints that have formulas.
      conditions: the constraints on positions and velocities, as sums that are zero.
      values: values of symbols that stand for functions of the parameters, such as moments of
        inertia.
      solved: whether the equations give the derivative of each entry.
      alone: whether the derivatives are alone on the left-hand side.
      kinematic: number of equations at the end that are rates of the attitude.
      followers: coordinates that follow from the free ones, if there are any.
      notes: meanings of symbols that a reader cannot guess.
    """

    symbols: Symbols
    law: str
    equations: tuple[Expression, ...]
    multipliers: tuple[Symbol, ...] = ()
    forces: tuple[Expression, ...] = ()
    energies: dict[str, Expression] = {}  # noqa: RUF012 never changed
    constant_energy: Expression | None = None
    conserved: dict[str, Expression] = {}  # noqa: RUF012 never changed
    reactions: tuple[Reaction, ...] = ()
    conditions: tuple[tuple[Expression, ...], tuple[Expression, ...]] = ((), ())
    values: dict[Symbol, float] = {}  # noqa: RUF012 never changed
    solved: bool = False
    alone: bool = False
    kinematic: int = 0
    followers: Followers | None = None
    notes: tuple[Note, ...] = ()

    def slope(self, x: Expression, by: Symbol) -> Expression:
        """The derivative of an expression by an entry of the state, through followers too."""
        return self.followers.slope(x, by) if self.followers else x.differentiate(by)


def derive(scene: Scene) -> DerivedEquations:
    """The equations of motion of a scene, by the law that fits its system."""
    system = scene.system
    if isinstance(system, FreePoints):
        return _newton(scene)
    if isinstance(system, NewtonEuler | Lagrange) and system.mechanism.opened_form():
        return _linkage(scene)
    if isinstance(system, _BY_LAGRANGE):
        return _lagrange(scene)
    if isinstance(system, RigidBody):
        return _rigid(scene)
    if isinstance(system, PolarParticle):
        return _polar(scene)
    if isinstance(system, Cylinder):
        return _cylinder(scene)
    return _as_given(scene)


def _row(arrays: Sequence[np.ndarray]) -> list[Expression]:
    return [x for array in arrays for x in np.ravel(array).tolist()]


def _parts(found: Symbols) -> tuple[list[Symbol], list[Symbol], list[Expression]]:
    n = len(found.state) // 2
    q, v = list(found.state[:n]), list(found.state[n:])
    return q, v, [as_expression(a) for a in found.rates[n:]]


def _newton(scene: Scene) -> DerivedEquations:
    """m_i a_i = sum of the forces on point i."""
    found = symbols(scene, halves(scene))
    _, _, a = _parts(found)

    def quantities(field, t, y):
        r, v, m = field.system.points(t, y)
        per_mass = [e for e in field.effects if e.accelerates]
        gravity = sum((e.acceleration(t, r, v, m) for e in per_mass), jnp.zeros_like(r))
        others = [e for e in field.effects if not e.accelerates]
        return gravity, total_force(others, t, r, v, m), m

    gravity, force, masses = read(scene, found, quantities)
    m = np.repeat(masses, scene.system.d)
    equations = []
    for mass, acceleration, g, f in zip(m, a, gravity.ravel(), force.ravel(), strict=True):
        whole = mass if mass else number(1)  # nothing but gravity moves a test particle
        equations.append(whole * acceleration - whole * g - f)
    energies = _energies(scene, found)
    return DerivedEquations(
        found,
        "Newton's law",
        tuple(equations),
        energies=energies,
        constant_energy=_constant_energy(scene, found, energies),
        conserved=_of_free_points(found, masses, masses[:, None] * gravity + force),
        alone=True,
    )


def _of_free_points(found: Symbols, m: np.ndarray, force: np.ndarray) -> dict[str, Expression]:
    """The components of momentum and of angular momentum about the origin whose rate is 0."""
    q, v, _ = _parts(found)
    n, d = force.shape
    r, v = (np.array([as_expression(s) for s in of], object).reshape(n, d) for of in (q, v))
    conserved = {}
    for k, axis in enumerate("xyz"[:d]):
        if _vanishes(force[:, k]):
            conserved[f"p_{axis}"] = total(m * v[:, k])
    for axis, (i, j) in {"x": (1, 2), "y": (2, 0), "z": (0, 1)}.items():
        if max(i, j) < d and _vanishes([*(r[:, i] * force[:, j]), *(-r[:, j] * force[:, i])]):
            conserved[f"H_{axis}"] = total(m * (r[:, i] * v[:, j] - r[:, j] * v[:, i]))
    return conserved


def _vanishes(parts: Iterable[Expression]) -> bool:
    """Whether a sum is 0; it may have more terms than an expression that is printed."""
    found: dict[Monomial, Coefficient] = {}
    for x in parts:
        for m, c in x.expand().terms.items():
            found[m] = found.get(m, 0) + c
    return not any(found.values())


def _constant_energy(
    scene: Scene, found: Symbols, energies: dict[str, Expression]
) -> Expression | None:
    """The sum of the energies, if all effects have a potential and time does not occur."""
    whole = total(energies.values())
    driven = found.time in whole.symbols() or _with_potential(scene, scene)[1]
    return None if driven else whole


def _energies(scene: Scene, found: Symbols) -> dict[str, Expression]:
    """Kinetic and potential energy."""
    (kinetic,) = read(scene, found, lambda field, t, y: field.system.kinetic(t, y))

    def potential(field, t, y):
        r, _, m = field.system.points(t, y)
        return potential_energy(field.effects, t, r, m)

    (potential_,) = read(scene, found, potential)
    return {"T": kinetic.item(), "V": potential_.item()}


def _lagrange(scene: Scene) -> DerivedEquations:
    """d/dt dL/dv - dL/dq = Q + G^T lambda."""
    found = symbols(scene, halves(scene))
    q, v, a = _parts(found)
    L, energies, values = _lagrangian(scene, found)
    by_time = _by_time(found, q, v, a)
    phi, rolling = _conditions(scene, found)
    conditions = [by_time(x) for x in phi] + rolling
    # The square of a distance has the shorter second derivative, and the distance is known.
    distances = [_distance(x) for x in phi]
    squares = [
        as_expression(d[0]) * Fraction(1, 2) if d else clear_denominators(x)
        for x, d in zip(phi, distances, strict=True)
    ]
    second = [by_time(by_time(x)) for x in squares] + [by_time(x) for x in rolling]
    lengths = {d[0]: d[1] for d in distances if d}
    multipliers = _multipliers(len(second))
    forces = _forces(scene, found)
    equations, others, conserved = [], [], {}
    for x, velocity, force in zip(q, v, forces, strict=True):
        momentum = L.differentiate(velocity)
        reaction = total(
            c.differentiate(velocity) * multiplier
            for c, multiplier in zip(conditions, multipliers, strict=True)
        )
        whole = by_time(momentum) - L.differentiate(x) - _with_lengths(reaction, lengths) - force
        equations.append(simplify(whole))
        others.append(simplify(force))
        if not conditions and not L.differentiate(x) and not force:
            conserved[f"p_{x.name}"] = simplify(momentum)
    equations += map(simplify, second)
    if len(multipliers) == 1:
        value = only_multiplier(equations, found.unknowns, multipliers[0], lengths)
        reactions = (Reaction(multipliers[0], value, _MULTIPLIERS),) if value else ()
    else:
        tied = bool(multipliers) or not isinstance(scene.system, MechanismSystem)
        reactions = () if tied else reactions_of(scene, found, by_time)
    constant = None
    # A constraint that moves does work, though its derivative may not contain the time.
    if not any(others) and not any(found.time in x.symbols() for x in (L, *phi, *rolling)):
        constant = simplify(total(as_expression(s) * L.differentiate(s) for s in v) - L)
    return DerivedEquations(
        found,
        "Lagrange's equations" + (" with multipliers" if second else ""),
        tuple(equations),
        multipliers=tuple(multipliers),
        notes=(Note(as_expression(_any_of(multipliers)), _MULTIPLIERS),) if multipliers else (),
        forces=tuple(others),
        energies=energies,
        constant_energy=constant,
        conserved=conserved,
        reactions=reactions,
        values=values,
        conditions=(tuple(map(simplify, phi)), tuple(map(simplify, rolling))),
    )


def _by_time(found: Symbols, q: Any, v: Any, a: Any) -> Callable[[Expression], Expression]:
    """The function that differentiates expressions with respect to time, along a motion."""
    rates = dict(zip((*q, *v, found.time), (*v, *a, 1), strict=True))
    return lambda x: total(x.differentiate(s) * as_expression(rate) for s, rate in rates.items())


def _multipliers(n: int) -> list[Symbol]:
    """lambda, or lambda1, lambda2 and so on."""
    numbers = [str(k + 1) if n > 1 else "" for k in range(n)]
    return [
        Symbol(f"lambda{k}", "multiplier", stem="lambda", index=k, rank=i)
        for i, k in enumerate(numbers)
    ]


_MULTIPLIERS = "the force or the moment of each constraint, in their order"


def _any_of(symbols: Sequence[Symbol]) -> Symbol:
    """The only symbol, or one without an index that stands for all of them."""
    return Symbol(symbols[0].stem, symbols[0].kind)


def _linkage(scene: Scene) -> DerivedEquations:
    """Lagrange's equations of the free coordinates, from which the other coordinates follow."""
    found = symbols(scene, halves(scene))
    of = opened_coordinates(scene, found)
    by_time = _by_time(found, of.q, of.v, of.a)

    def quantities(field, t, y, s, u):
        free, speeds = jnp.split(y, 2)
        q, v = jnp.concatenate([free, s]), jnp.concatenate([speeds, u])
        mechanism = field.system.mechanism.opened_form().mechanism
        others = _with_potential(scene, field)[1]
        direct = on_coordinates(t, free, speeds, field.effects)
        forces = pull_back(mechanism, t, q, v, others)
        forces = forces + jnp.concatenate([direct, jnp.zeros_like(s)])
        return *_of_points(mechanism, field.effects, t, q, v), forces, mechanism.constraints(t, q)

    kinetic, potential, forces, ties = read(scene, found, quantities, *of.followers)
    kinetic, potential = kinetic.item(), potential.item()
    L = kinetic - potential
    laws = [
        by_time(L.differentiate(v)) - L.differentiate(q) - force
        for q, v, force in zip(of.q, of.v, forces.tolist(), strict=True)
    ]
    phi = ties.tolist()
    driven = any(forces.tolist()) or any(found.time in x.symbols() for x in (L, *phi))
    followers = find_followers(scene, of, phi, [by_time(by_time(x)) for x in phi])
    return DerivedEquations(
        found,
        "Lagrange's equations",
        eliminate_followers(of, followers, laws),
        energies={"T": kinetic, "V": potential},
        constant_energy=None if driven else kinetic + potential,
        conditions=(tuple(map(simplify, phi)), ()),
        followers=followers,
    )


def _distance(x: Expression) -> tuple[Expression, Expression] | None:
    """The terms s and l of a constraint sqrt(s) - l."""
    for m, c in x.terms.items():
        if c == 1 and len(m) == 1 and isinstance(m[0][0], Group) and m[0][1] == Fraction(1, 2):
            length = Expression({m: c}) - x
            if all(s.kind == "parameter" for s in length.symbols()):
                return m[0][0].sum, length
    return None


def _with_lengths(x: Expression, lengths: Mapping[Expression, Expression]) -> Expression:
    """The distance of the ends of a rod replaced by its length."""
    found = number(0)
    for m, c in x.terms.items():
        term = number(c)
        for a, e in m:
            known = lengths.get(a.sum) if isinstance(a, Group) else None
            term = term * (as_expression(a) ** e if known is None else known ** (2 * e))
        found = found + term
    return found


def _lagrangian(
    scene: Scene, found: Symbols
) -> tuple[Expression, dict[str, Expression], dict[Symbol, float]]:
    """L, the energies in it, and the values of further symbols in them."""
    system: Any = scene.system
    values: dict[Symbol, float] = {}
    if isinstance(getattr(system, "mechanism", None), EulerBody) and all(
        isinstance(e, UniformGravity) for e in scene.effects
    ):
        kinetic, potential, values = _of_body(scene, found)
    elif isinstance(system, LinearSystem) or (
        isinstance(system, Lagrangian) and len(system.functions) == 2
    ):
        kinetic, potential = _row(
            read(scene, found, lambda field, t, y: field.system.energies(t, y, ()))
        )
    elif isinstance(system, Lagrangian) or (
        isinstance(system, Lagrange) and type(system).lagrangian is not Lagrange.lagrangian
    ):

        def whole(field, t, y):
            q, v = jnp.split(y, 2)
            if isinstance(field.system, Lagrangian):
                return field.system.lagrangian(t, q, v)
            return field.system.lagrangian(t, q, v, _with_potential(scene, field)[0])

        (L,) = read(scene, found, whole)
        return L.item(), {"L": L.item()}, values
    else:

        def both(field, t, y):
            return _of_points(field.system.mechanism, field.effects, t, *jnp.split(y, 2))

        kinetic, potential = _row(read(scene, found, both))
    return kinetic - potential, {"T": kinetic, "V": potential}, values


def _of_points(mechanism: Mechanism, effects, t, q, v) -> tuple:
    """The kinetic energy of the points of a mechanism, and their potential energy."""
    r, velocity = positions_and_velocities(mechanism, t, q, v)
    m = mechanism.masses()
    kinetic = 0.5 * jnp.sum(m[:, None] * velocity * velocity)
    return kinetic, potential_energy(effects, t, r, m)


def _of_body(scene: Scene, found: Symbols) -> tuple[Expression, Expression, dict[Symbol, float]]:
    """The energies of a body in Euler angles, and the values of its moments of inertia."""
    system: Any = scene.system
    matter = _Matter(system.mechanism.matter)

    def pose(field, t, y):
        found = field.system.mechanism.pose(*jnp.split(y, 2))
        return found.r, found.v, found.R_wb, found.omega_b, [e.g for e in field.effects]

    r, v, R, omega, *gravity = read(scene, found, pose)
    kinetic = total(matter.mass * x * x for x in v) + omega @ (matter.inertia @ omega)
    # If the origin of the body's axes is not its centre, both move: 2 m v . (omega x c).
    swept = R @ np.cross(omega, matter.arm)
    kinetic = kinetic + total(2 * matter.mass * a * b for a, b in zip(v, swept, strict=True))
    height = r[2] + R[2] @ matter.arm
    weight = matter.mass * total(g.item() for g in gravity)
    return simplify(kinetic * Fraction(1, 2)), simplify(weight * height), matter.values


def _with_potential(scene: Scene, field) -> tuple[tuple, tuple]:
    """The effects of a field with a potential, and those without."""
    t, (r, _, m) = jnp.zeros(()), scene.system.points(jnp.zeros(()), scene.y0)
    has = [e.potential(t, r, m) is not None for e in scene.effects]
    pairs = list(zip(field.effects, has, strict=True))
    return tuple(e for e, yes in pairs if yes), tuple(e for e, yes in pairs if not yes)


def _forces(scene: Scene, found: Symbols) -> list[Expression]:
    """Generalised forces of the effects without a potential."""

    def forces(field, t, y):
        q, v = jnp.split(y, 2)
        direct = on_coordinates(t, q, v, field.effects)
        if not isinstance(field.system, MechanismSystem):
            return direct
        others = _with_potential(scene, field)[1]
        return direct + pull_back(field.system.mechanism, t, q, v, others)

    return _row(read(scene, found, forces))


def _conditions(scene: Scene, found: Symbols) -> tuple[list[Expression], list[Expression]]:
    """Holonomic constraints, and rolling conditions on the velocities."""
    system: Any = scene.system
    if not isinstance(system, Constrained | LagrangeSkates):
        return [], []

    def both(field, t, y):
        q, v = jnp.split(y, 2)
        ties, rows = field.system.mechanism.constraints(t, q), field.system.mechanism.rolling(t, q)
        none = jnp.zeros(0)
        speeds = none if rows is None else jnp.sum(rows * v[None, :], axis=-1)
        return (none if ties is None else ties), speeds

    ties, speeds = read(scene, found, both)
    return ties.tolist(), speeds.tolist()


def _polar(scene: Scene) -> DerivedEquations:
    """m (r'' - r theta'^2) = F_r, m (r theta'' + 2 r' theta') = F_theta."""
    found = symbols(scene, halves(scene))
    (r, _), (vr, omega), (ar, alpha) = _parts(found)
    radius, speed = as_expression(r), as_expression(vr)

    def forces(field, t, y):
        (force,) = total_force(field.effects, t, *field.system.points(t, y))
        return [jnp.sum(force * e) for e in polar_basis(y[1])], field.system.m

    along, across, m = _row(read(scene, found, forces))
    equations = (
        m * ar - m * radius * as_expression(omega) ** 2 - along,
        m * radius * alpha + 2 * m * speed * omega - across,
    )
    energies = _energies(scene, found)
    return DerivedEquations(
        found,
        "Newton's law in polar coordinates",
        equations,
        forces=(along, across),
        energies=energies,
        constant_energy=_constant_energy(scene, found, energies),
        conserved={} if across else {"p_theta": m * radius**2 * as_expression(omega)},
    )


def _rigid(scene: Scene) -> DerivedEquations:
    """m dv/dt = F, I domega/dt + omega x I omega = M, and the rate of the attitude."""
    system: Any = scene.system
    n = len(scene.labels())
    free = 0 if system.pivoted else 3
    found = symbols(scene, {n - 6 + i: i for i in range(free)})
    velocity = found.state[n - 6 : n - 6 + free]
    omega, turn = (
        np.array([as_expression(s) for s in of[-3:]]) for of in (found.state, found.rates)
    )
    matter = _Matter(system.matter)
    R, force, torque, potential = _loads(scene, found, matter)
    momentum = matter.inertia @ omega
    equations = [
        matter.mass * as_expression(found.rates[n - 6 + i]) - force[i] for i in range(free)
    ]
    equations += [*(matter.inertia @ turn + np.cross(omega, momentum) - torque)]

    def turning_rate(field, t, y):
        return field.system.attitude.rate(_attitude(field, y), y[-3:])

    attitude = _row(read(scene, found, turning_rate))
    rates = found.rates[free : n - 3 - free]
    kinematic = [as_expression(rate) - x for rate, x in zip(rates, attitude, strict=True)]
    energies = {
        "T": total(matter.mass * as_expression(v) ** 2 for v in velocity) * Fraction(1, 2)
        + omega @ momentum * Fraction(1, 2),
        "V": potential,
    }
    linear = {
        f"p_{axis}": matter.mass * as_expression(v)
        for axis, v, f in zip("xyz", velocity, force, strict=False)
        if not f
    }
    angular = _angular_momenta(R, momentum, omega, torque)
    about = "angular momentum about the " + ("mass centre" if free else "fixed point")
    about += ", along the fixed axes x, y, z"
    about += " and along the third axis of the body" if "H_3" in angular else ""
    law = "Newton's law and Euler's equations" if free else "Euler's equations"
    return DerivedEquations(
        found,
        law,
        (*equations, *kinematic),
        forces=(*force[:free], *torque),
        energies=energies,
        constant_energy=_constant_energy(scene, found, energies),
        conserved=linear | angular,
        values=matter.values,
        notes=(
            *(
                Note(as_expression(Symbol(stem, "coordinate")), meaning)
                for stem, meaning in _ATTITUDE
                if any(s.stem == stem for s in found.state)
            ),
            *([Note(_H, about)] if angular else ()),
        ),
        kinematic=len(kinematic),
        alone=True,
    )


def _angular_momenta(R, momentum, omega, torque: np.ndarray) -> dict[str, Expression]:
    """The conserved ones: along fixed axes, and along the third axis of a symmetric body."""
    found = {
        f"H_{axis}": row @ momentum
        for axis, row in zip("xyz", R, strict=True)
        if _vanishes(row * torque)
    }
    turned = momentum[0] * omega[1] - momentum[1] * omega[0]
    if torque[2] == number(0) and not _vanishes([momentum[2]]) and _vanishes([turned]):
        found["H_3"] = momentum[2]
    return found


class _Matter:
    """The mass, the centre and the inertia of a body as symbols.

    Values that are 0 have no symbol, and equal values share one.

    Attributes:
      mass: m.
      arm: (3) position of the centre, from the origin of the body's axes.
      inertia: (3, 3) inertia about that origin.
      values: values of the symbols.
    """

    def __init__(self, matter: MaterialPoints):
        r, m = (np.asarray(x) for x in matter)
        # This is one program, or each operation would be compiled by itself.
        centre, inertia = m @ r / m.sum(), np.asarray(jax.jit(inertia_matrix)(matter))
        self.values: dict[Symbol, float] = {}
        self.mass = self._symbol("m", "", m.sum(), 2, 0.0)
        least = _ROUNDED * np.abs(r).max()
        on_axis = (np.abs(centre) > least).sum() == 1
        self.arm = np.array(
            [
                self._symbol("l" if on_axis else "c", "" if on_axis else str(i + 1), x, 6, least)
                for i, x in enumerate(centre)
            ]
        )
        least = _ROUNDED * np.abs(inertia).max()
        principal = np.abs(inertia - np.diag(np.diag(inertia))).max() <= least
        self.inertia = np.full((3, 3), number(0))
        for i in range(3):
            for j in range(i, 3):
                index = str(i + 1) if principal else f"{i + 1}{j + 1}"
                same = [k for k in range(i) if abs(inertia[k, k] - inertia[i, i]) <= least]
                if principal and i == j and same:
                    self.inertia[i, i] = self.inertia[same[0], same[0]]
                    continue
                x = self._symbol("I", index, inertia[i, j], 3 + 0.1 * i, least)
                self.inertia[i, j] = self.inertia[j, i] = x

    def _symbol(self, stem: str, index: str, value: float, rank: float, least: float) -> Expression:
        if abs(value) <= least:
            return number(0)
        found = Symbol(
            stem + index, "parameter", stem=stem, index=index, rank=rank, positive=value > 0
        )
        self.values[found] = float(value)
        return as_expression(found)


#: Coordinates of the centre and products of inertia up to this relative size are rounding.
_ROUNDED = 1e-14


def _attitude(field, y):
    """The numbers of the attitude in a state."""
    return y[:-3] if field.system.pivoted else y[3:-6]


def _loads(
    scene: Scene, found: Symbols, matter: _Matter
) -> tuple[np.ndarray, np.ndarray, np.ndarray, Expression]:
    """Rotation matrix of a body, force on it, torque in its axes, and potential energy."""
    free = not scene.system.pivoted
    force, torque, potential = np.full(3, number(0)), np.full(3, number(0)), number(0)
    heavy = [isinstance(e, UniformGravity) for e in scene.effects]

    def attitude(field, t, y):
        return field.system.attitude.matrix(_attitude(field, y)), [
            e.g for e, yes in zip(field.effects, heavy, strict=True) if yes
        ]

    R, *gravity = read(scene, found, attitude)
    if isinstance(scene.system.attitude, Quaternion):
        # The quaternion has length 1, which the program of the matrix does not assume.
        square = total(as_expression(s) ** 2 for s in found.state[3 * free : 3 * free + 4])
        one = {Group(square): number(1)}
        R = objects([simplify(x.replace(one.get)) for x in R.ravel()], (3, 3))
    for g in gravity:
        weight = matter.mass * g.item()
        force[2] = force[2] - weight
        torque = torque + np.cross(matter.arm, R[2] * -weight)
        height = (as_expression(found.state[2]) if free else 0) + R[2] @ matter.arm
        potential = potential + weight * height

    def others(field, t, y):
        """The load of all other effects, and its potential energy."""
        system = field.system
        effects = tuple(e for e, yes in zip(field.effects, heavy, strict=True) if not yes)
        r, _, m = system.points(t, y)
        return *system.load(t, y, effects), potential_energy(effects, t, r, m)

    if all(heavy):
        return R, force, torque, potential
    more_force, more_torque, energy = read(scene, found, others)
    return R, force + more_force, torque + more_torque, potential + energy.item()


_H = as_expression(Symbol("H", "short"))
_CONTACT = ("normal force of the surface", "friction, along the surface")
#: Notes for a body with a quaternion.
_ATTITUDE = (
    ("omega", "angular velocity, along the axes of the body"),
    ("q", "the unit quaternion that rotates the fixed axes to those of the body"),
)


def _cylinder(scene: Scene) -> DerivedEquations:
    """m a = W + N n + F t, and the moments of both about the centre of mass."""
    system: Any = scene.system
    found = symbols(scene, halves(scene))
    _, _, a = _parts(found)

    def quantities(field, t, y):
        system = field.system
        contact = system._conditions(y)
        weights = jnp.stack([system.m, system.m, system.inertia])
        slip = -SLIPS.get(system.contact, 0.0) * system.mu
        return weights, system._load(t, y, field.effects), contact.rows, contact.bends, slip

    weights, load, rows, bends, ratio = read(scene, found, quantities)
    touching = {"fly": 0, "roll": 2}.get(system.contact, 1)
    N, F = (Symbol(name, "multiplier", rank=i) for i, name in enumerate("NF"))
    forces = (as_expression(N), as_expression(F))[:touching]
    if touching == 1:
        forces = (forces[0], ratio.item() * forces[0])
    reactions = [total(f * row[i] for f, row in zip(forces, rows, strict=False)) for i in range(3)]
    laws = [weights[i] * a[i] - load[i] - reactions[i] for i in range(3)]
    energies, slips = _energies(scene, found), touching == 1 and ratio.item()
    conditions = [total(rows[k, i] * a[i] for i in range(3)) - bends[k] for k in range(touching)]
    return DerivedEquations(
        found,
        "Newton's law with the forces of contact",
        tuple(map(simplify, (*laws, *conditions))),
        multipliers=(N, F)[:touching],
        notes=tuple(map(Note, map(as_expression, (N, F)[:touching]), _CONTACT)),
        energies=energies,
        constant_energy=None if slips else _constant_energy(scene, found, energies),
        alone=True,
    )


def _as_given(scene: Scene) -> DerivedEquations:
    """The rate as it is written."""
    plain = symbols(scene, {})
    (rates,) = read(scene, plain, lambda field, t, y: field.rate(t, y))
    entries = [as_expression(s) for s in plain.state]
    of_others = {entries.index(rate): i for i, rate in enumerate(rates.tolist()) if rate in entries}
    # An entry that is a derivative counts as a velocity only if its own derivative is not an entry.
    pairs = {v: q for v, q in of_others.items() if v not in of_others.values() and v != q}
    found = symbols(scene, pairs)
    names = {a: as_expression(b) for a, b in zip(plain.state, found.state, strict=True)}
    equations = tuple(
        as_expression(rate) - x.replace(names.get)
        for rate, x in zip(found.rates, rates.tolist(), strict=True)
        if rate in found.unknowns
    )
    energies = {}
    prescribed = isinstance(scene.system, Prescribed)
    if scene.has_energy and not prescribed:
        terms = read(scene, found, lambda field, t, y: field.system.energies(t, y, field.effects))
        both = [x.item() for x in terms]
        energies = {"T": both[0], "V": both[1]} if len(both) == 2 else {"E": total(both)}
    law = "Prescribed motion" if prescribed else "Equations of motion"
    whole = total(energies.values())
    rate = [x.replace(names.get) for x in rates.tolist()]
    slopes = [whole.differentiate(s) * x for s, x in zip(found.state, rate, strict=True)]
    constant = energies and _vanishes([*slopes, whole.differentiate(found.time)])
    return DerivedEquations(
        found,
        law,
        equations,
        energies=energies,
        constant_energy=whole if constant else None,
        solved=True,
        alone=True,
    )
