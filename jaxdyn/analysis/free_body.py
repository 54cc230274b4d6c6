"""Free bodies: the forces on each body of a scene, their moments, and the body's acceleration.

The forces come from the effects, from the loads that a system's own equations contain, and from the
joints (hinges, rods, wires, contacts). In a constrained formulation, and in the equations of a
cylinder in contact, the forces in joints are among the unknowns, and are taken from there. In
minimal coordinates no equation contains them: they are found from the balance of forces and moments
of all bodies together. The balance has more equations than unknowns, by one for each degree of
freedom, so it is a test in that case too.

Accelerations are derivatives of the velocities of the material points along the rate, and do not
use any of these forces: `FreeBodies.residual` says how far sum F = m a and sum M = dL/dt, about the
mass centre of each body, are satisfied.
"""

import dataclasses
import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._checks import check_first
from jaxdyn._text import brief, table
from jaxdyn.analysis.static_friction import with_static_friction
from jaxdyn.formulations.attitude import Attitude
from jaxdyn.formulations.extended import Extended
from jaxdyn.joints import Joint, Load, Part
from jaxdyn.scene import Effect, Field, Points, Scene
from jaxdyn.system import System, generalized_forces

#: Sources of a force.
EFFECT, MULTIPLIER, BALANCE = "effect", "multiplier", "balance"

#: Residual above which the bodies and joints of a system do not describe its equations.
_WRONG = 1e-6
#: Least ratio of a singular value to the largest, for independent unknowns.
_RANK = 1e-11


class Force(NamedTuple):
    """A force on a free body.

    Attributes:
      name: the name of its effect or joint.
      force: (d,) [N].
      at: (d,) its point of application [m].
      couple: the couple that acts with it: () in the plane, (3,) in space [N m].
      source: "effect"; "multiplier" of a constraint, from the equations of motion; "balance" where
        it follows from the balance of forces and moments.
    """

    name: str
    force: np.ndarray
    at: np.ndarray
    couple: np.ndarray
    source: str

    def moment(self, about: np.ndarray) -> np.ndarray:
        """The moment about a point (d,): () in the plane, (3,) in space [N m]."""
        return _cross(self.at - about, self.force) + self.couple


class FreeBody(NamedTuple):
    """A body with all forces on it.

    Attributes:
      name: the body's name.
      m: its mass [kg].
      centre: (d,) its centre of mass [m].
      velocity: (d,) velocity of the centre [m/s].
      acceleration: (d,) acceleration of the centre [m/s^2].
      angular_momentum: angular momentum about the centre, () or (3,) [kg m^2/s].
      angular_rate: its derivative with respect to time [N m].
      inertial: sums over its points of the magnitudes of the terms of m a, and of their moments,
        whose rounding is that of m a and of dL/dt [N, N m].
      forces: the forces on it.
      rigid: whether it can turn; False for a particle.
      outline: its shapes in pictures; () where the sketch of the scene shows it.
    """

    name: str
    m: float
    centre: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    angular_momentum: np.ndarray
    angular_rate: np.ndarray
    inertial: tuple[float, float]
    forces: tuple[Force, ...]
    rigid: bool
    outline: tuple

    @property
    def force(self) -> np.ndarray:
        """(d,) the sum of the forces [N]."""
        return sum((f.force for f in self.forces), np.zeros_like(self.centre))

    @property
    def moment(self) -> np.ndarray:
        """The sum of their moments about the mass centre, () or (3,) [N m]."""
        return sum((f.moment(self.centre) for f in self.forces), np.zeros_like(self.angular_rate))


class FreeBodies(NamedTuple):
    """All bodies of a scene as free bodies; see `free_body`.

    Attributes:
      t: time [s].
      bodies: the bodies of the scene.
      largest: magnitude of the largest force, or of the largest m a if that is larger [N].
      residual: largest difference of sum F and m a on a body over `largest`, or of sum M and dL/dt
        over the largest moment [1].
      units: those of mass, length, force, moment and time; "" where the numbers have none, as with
        G = 1.
      determined: whether the equations determine all forces; where they do not, as with one rod
        too many, those of least norm are taken.
    """

    t: float
    bodies: tuple[FreeBody, ...]
    largest: float
    residual: float
    units: tuple[str, str, str, str, str]
    determined: bool

    def body(self, name: str) -> FreeBody:
        """The body of this name.

        Raises:
          ValueError: none has it.
        """
        named = {body.name: body for body in self.bodies}
        return named[_checks.choice("name", name, named)]

    @_text.never_raising
    def __repr__(self) -> str:
        kg, m, newton, moment, second = self.units
        rows = []
        for body in self.bodies:
            rows += [(body.name, f"m = {brief(body.m, kg)}, at {brief(body.centre, m)}")]
            for f in body.forces:
                couple = f", couple {brief(f.couple, moment)}" if np.any(f.couple) else ""
                said = ", found from the balance" if f.source == BALANCE else ""
                where = f"{brief(f.force, newton)} at {brief(f.at, m)}"
                rows += [(f"  {f.name}", where + couple + said)]
            rows += [("  sum", f"{brief(body.force, newton)} = m a")]
            if body.rigid:
                rows += [("  moments", f"{brief(body.moment, moment)} = dL/dt")]
        rows += [("residual", f"{self.residual:.1e} of the largest force or moment")]
        return table(f"Free bodies at t = {brief(self.t, second)}", rows)

    _repr_html_ = _text.html


@check_first
def free_body(scene: Scene, t=0.0, y=None) -> FreeBodies:
    """The free bodies of a scene at a state: each body with all forces on it.

    Args:
      scene: a scene of particles, rods, hinged bars, rigid bodies, wires, skates or contacts.
      t: () time [s].
      y: (k,) state; the scene's start by default.
    Returns:
      The forces on each body, by the names of effects and joints, their points of application and
      moments, the accelerations, and the residual of the balance.
    Raises:
      ValueError: the bodies of the scene are not known (an `ode`, a Lagrangian, a moving frame), it
        has a prescribed motion, an effect acts on coordinates that are not those of bodies, or
        forces and accelerations do not agree.
    Example:
      >>> from jaxdyn import scenes
      >>> from jaxdyn.analysis.free_body import free_body
      >>> free_body(scenes.pendulum(m=2.0, angle=0.0))
      Free bodies at t = 0 s
        mass      m = 2 kg, at (0, -1) m
          weight  (0, -19.62) N at (0, -1) m
          stick   (0, 19.62) N at (0, -1) m, found from the balance
          sum     (0, 0) N = m a
        residual  0.0e+00 of the largest force or moment
    """
    _checks.check_on_host("free_body", (scene, t, y))
    _checks.float64()
    t = _checks.array("t", t, ())
    y = scene.y0 if y is None else _checks.array("y", y, np.shape(scene.y0))
    system = scene.system
    while isinstance(system, Extended):
        t, y = system.inside(t, y)
        system = system.system
    parts = system.bodies(t, y)
    if not parts:
        raise _checks.fail(
            "scene",
            "one whose bodies are known",
            type(getattr(system, "mechanism", system)).__name__,
            "Its equations are not forces on bodies at rest or in motion in space (an ode, a "
            "Lagrangian, a rotating frame, a prescribed motion), or its class has no `bodies`.",
        )
    found = _found(dataclasses.replace(scene, system=system, y0=y), jnp.asarray(t, float))
    points = Points(*map(np.asarray, found.points))
    accelerations = np.asarray(found.a), np.asarray(found.terms)
    bodies = [_body(part, points, *accelerations) for part in found.parts]
    forces = [_effect_forces(system, found, points, bodies), _load_forces(found.loads, bodies)]
    known = [[f for some in forces for f in some[i]] for i in range(len(bodies))]
    bodies = [body._replace(forces=tuple(own)) for body, own in zip(bodies, known, strict=True)]
    bodies, determined = _with_joints(bodies, found.joints, found.multipliers)
    largest, residual = _residual(bodies)
    if not residual <= _WRONG:
        raise _checks.fail(
            "scene",
            "bodies whose forces give their accelerations",
            f"a difference of {residual:.1e} of the largest force",
            f"The `bodies` and `joints` of {type(system).__name__} do not describe its equations.",
        )
    kg, m, newton, moment, second = map(scene.in_units, ("kg", "m", "N", "N m", "s"))
    units = kg, m, newton, moment, second or _text.second(scene.labels())
    return FreeBodies(float(t), tuple(bodies), largest, residual, units, determined)


class _Found(NamedTuple):
    """What JAX evaluates: points, accelerations (n, d), the sizes of their terms, forces."""

    points: Points
    a: Array
    terms: Array
    parts: tuple[Part, ...]
    joints: tuple[Joint, ...]
    loads: tuple[Load, ...]
    multipliers: Array | None
    pieces: tuple[tuple[str, Array], ...]
    on_coordinates: tuple[tuple[str, Array, Array | None], ...]
    attitude: Array | None


def _pieces(field: Field, acts: str, m: Array) -> list[Effect]:
    """The pieces of all effects that act in the given way."""
    effects = [one for effect in field.effects for one in effect.pieces(m)]
    return [one for one in effects if acts in one.acts]


def _forces(field: Field, t: Array, y: Array) -> tuple[list, list, Array | None]:
    """Forces of each piece of the effects on points and on coordinates, and those in joints."""
    system = field.system
    points = system.points(t, y)
    turned = _pieces(field, "generalized", points.m)
    return (
        [e.force(t, *points) for e in _pieces(field, "force", points.m)],
        [generalized_forces((e,), t, *system.coordinates(y))[0] for e in turned],
        system.constraint_forces(t, y, field.effects),
    )


def _all_forces(field: Field, t: Array, y: Array) -> Array:
    """`_forces` in one vector."""
    forces = jax.tree.leaves(_forces(field, t, y))
    return jnp.concatenate([jnp.zeros(0), *map(jnp.ravel, forces)])


@eqx.filter_jit
def _found(scene: Scene, t: Array) -> _Found:
    """Points, accelerations and forces at the start of a scene."""
    field, system, y = scene.field, scene.system, jnp.asarray(scene.y0)
    rate, flat = with_static_friction(scene, _all_forces, t, y, t + jnp.abs(scene.t1))(t, y)
    shapes, tree = jax.tree.flatten(jax.eval_shape(_forces, field, t, y))
    each = jnp.split(flat, np.cumsum([math.prod(x.shape) for x in shapes])[:-1])
    forces = [x.reshape(like.shape) for x, like in zip(each, shapes, strict=bool(shapes))]
    on_points, on_coordinates, multipliers = jax.tree.unflatten(tree, forces)
    points, (_, a, _) = jax.jvp(system.points, (t, y), (jnp.ones_like(t), rate))
    turning = jax.jacfwd(lambda y: system.points(t, y).v)(y)
    pushing, turned = (_pieces(field, acts, points.m) for acts in ("force", "generalized"))
    return _Found(
        points=points,
        a=a,
        terms=jnp.sum(jnp.abs(turning * rate[None, None]), axis=-1),
        parts=system.bodies(t, y),
        joints=system.joints(t, y),
        loads=system.loads(t, y),
        multipliers=multipliers,
        pieces=tuple((_name(e), f) for e, f in zip(pushing, on_points, strict=True)),
        on_coordinates=tuple(
            (_name(e), f, e.attack(t, *system.coordinates(y)))
            for e, f in zip(turned, on_coordinates, strict=True)
        ),
        attitude=_attitude(system, y),
    )


def _attitude(system: System, y: Array) -> Array | None:
    """R_wb (3, 3) of a rigid body, whose generalised torques are in its own axes; else None."""
    if isinstance(getattr(system, "attitude", None), Attitude):
        return system.pose(y).R_wb
    return None


def _name(effect: Effect) -> str:
    return effect.called or _text.words(effect)


def _body(part: Part, points: Points, a: np.ndarray, terms: np.ndarray) -> FreeBody:
    index, m = np.array(part.points, int), np.asarray(part.m)
    total = float(m.sum())
    weights = m / total if total else np.full(len(m), 1 / max(len(m), 1))
    if len(m):
        r, v, acc = (x[index] for x in (points.r, points.v, a))
        centre, velocity, acceleration = (weights @ x for x in (r, v, acc))
        arm, swing, turn = r - centre, v - velocity, acc - acceleration
        spin, rate = (_cross(arm, m[:, None] * moved).sum(axis=0) for moved in (swing, turn))
        sizes = np.abs(m) * np.linalg.norm(terms[index], axis=1)
        inertial = float(sizes.sum()), float(sizes @ np.linalg.norm(arm, axis=1))
    else:
        centre = np.asarray(part.at)
        velocity = acceleration = np.zeros_like(centre)
        spin, rate, inertial = *[_cross(centre, 0 * centre)] * 2, (0.0, 0.0)
    return FreeBody(
        part.name,
        total,
        centre,
        velocity,
        acceleration,
        np.asarray(spin),
        np.asarray(rate),
        inertial,
        (),
        part.rigid,
        part.outline,
    )


def _effect_forces(
    system: System, found: _Found, points: Points, bodies: list[FreeBody]
) -> list[list[Force]]:
    """The forces of the effects on each body."""
    pairs = list(zip(found.parts, bodies, strict=True))
    # (name, its force on each body, None for none)
    pieces = [
        (name, [_force_on_body(np.asarray(f), part, found.parts, points, b) for part, b in pairs])
        for name, f in found.pieces
    ]
    for name, f, at in found.on_coordinates:
        pieces.append((name, _wrenches(system, name, np.asarray(f), at, found, bodies)))
    names = [name for name, _ in pieces]
    acting: list[list[Force]] = [[] for _ in bodies]
    for i, (name, forces) in enumerate(pieces):
        pushed = [(k, force) for k, force in enumerate(forces) if force is not None]
        for k, force in pushed:
            called = name
            if names.count(name) > 1:
                others = [bodies[j].name for j, _ in pushed if j != k]
                called = f"{name} {names[:i].count(name) + 1}"
                called = f"{name} of {others[0]}" if len(others) == 1 else called
            acting[k].append(force._replace(name=called))
    return acting


def _force_on_body(
    f: np.ndarray, part: Part, parts: tuple[Part, ...], points: Points, body: FreeBody
) -> Force | None:
    """The force of an effect on a body: at the only point it acts on, or at the mass centre."""
    index = np.array(part.points, int)
    f = f[index] * _shares(part, parts, points)[:, None]
    acted = np.flatnonzero(np.any(f != 0, axis=1))
    if not len(acted):
        return None
    total, arms = f.sum(axis=0), points.r[index] - body.centre
    none = np.zeros_like(body.angular_rate)
    if len(acted) == 1:
        return Force("", total, points.r[index][acted[0]], none, EFFECT)
    moments = _cross(arms, f)
    couple = moments.sum(axis=0)
    # For a force proportional to mass, the couple is only rounding of the points' positions.
    reach = np.abs(points.r[index]).sum(axis=1) + np.abs(body.centre).sum()
    size = float(reach @ np.linalg.norm(f, axis=1))
    couple = np.where(np.abs(couple) <= 8 * np.finfo(float).eps * size, 0.0, couple)
    return Force("", total, body.centre, couple, EFFECT)


def _shares(part: Part, parts: tuple[Part, ...], points: Points) -> np.ndarray:
    """(p,) the share of a body in the force on each of its points: its share of the mass."""
    index, m = np.array(part.points, int), np.asarray(part.m)
    shared = np.array([sum(i in one.points for one in parts) for i in index])
    whole = points.m[index]
    return np.where(whole == 0, 1 / np.maximum(shared, 1), m / np.where(whole == 0, 1.0, whole))


def _wrenches(
    system: System, name: str, f: np.ndarray, at: Array | None, found: _Found, bodies: list
) -> list[Force | None]:
    """Forces and couples on the bodies from a force on coordinates."""
    n, d = len(bodies), found.points.r.shape[1]
    units = [unit for _, unit in system.labels()][: len(f)]
    if found.attitude is not None and d == 3:
        both = np.concatenate([np.zeros(6 - len(f)), f])
        rows = [(both[:3], np.asarray(found.attitude) @ both[3:])]
    elif d == 2 and units == ["m", "m", "rad"] * n:
        rows = [(row[:2], row[2]) for row in f.reshape(n, 3)]
    elif units == ["m"] * (n * d):
        rows = [(row, np.zeros_like(bodies[0].angular_rate)) for row in f.reshape(n, d)]
    elif d == 2 and len(f) == n and all(body.rigid for body in bodies) and units == ["rad"] * n:
        rows = [(np.zeros(2), couple) for couple in f]
    else:
        raise _checks.fail(
            name,
            "forces on points, or on coordinates that are places and angles of bodies",
            f"forces on {', '.join(label for label, _ in system.labels()[: len(f)])}",
            "Take a formulation in the coordinates of the bodies, or leave the effect out.",
        )
    out: list[Force | None] = []
    for body, (force, couple) in zip(bodies, rows, strict=True):
        place = body.centre if at is None else np.asarray(at)
        couple = np.asarray(couple - _cross(place - body.centre, force))
        acts = np.any(force) or np.any(couple)
        out.append(Force("", np.asarray(force), place, couple, EFFECT) if acts else None)
    return out


def _load_forces(loads: tuple[Load, ...], bodies: list[FreeBody]) -> list[list[Force]]:
    acting: list[list[Force]] = [[] for _ in bodies]
    for load in loads:
        none = np.zeros_like(bodies[load.on].angular_rate)
        force = Force(load.name, np.asarray(load.force), np.asarray(load.at), none, EFFECT)
        acting[load.on].append(force)
    return acting


def _with_joints(
    bodies: list[FreeBody], joints: tuple[Joint, ...], multipliers: Array | None
) -> tuple[list[FreeBody], bool]:
    """The bodies with the forces in their joints, and whether these are determined."""
    joints = jax.tree.map(lambda x: np.asarray(x) if eqx.is_array(x) else x, joints)
    unknown = []
    for joint in joints:
        if multipliers is None or joint.multiplier is None:
            unknown.append(joint)
        else:
            first = joint.multiplier
            x = np.asarray(multipliers)[first : first + len(joint.directions)]
            bodies = _with_joint(bodies, joint, x, MULTIPLIER)
    if not unknown:
        return bodies, True
    size = max([np.abs(j.at - bodies[j.on].centre).max() for j in joints], default=0.0) or 1.0
    free = [b._replace(forces=()) for b in bodies]
    columns = [
        _equations(_with_joint(free, joint, unit, BALANCE), size)
        for joint in unknown
        for unit in np.eye(len(joint.directions))
    ]
    missing = []
    for b in bodies:
        force, couple = b.m * b.acceleration - b.force, b.angular_rate - b.moment
        missing.append(b._replace(forces=(Force("", force, b.centre, couple, EFFECT),)))
    matrix = np.stack(columns, axis=1)
    found, _, rank, _ = np.linalg.lstsq(matrix, _equations(missing, size), rcond=_RANK)
    for joint in unknown:
        amount, found = np.split(found, [len(joint.directions)])
        bodies = _with_joint(bodies, joint, amount, BALANCE)
    return bodies, bool(rank == matrix.shape[1])


def _with_joint(bodies: list[FreeBody], joint: Joint, x: np.ndarray, source: str) -> list[FreeBody]:
    """The bodies with the force in one joint."""
    bodies = list(bodies)
    other = joint.at if joint.other is None else joint.other
    for i, sign, at in ((joint.on, 1.0, joint.at), (joint.by, -1.0, other)):
        if i is not None:
            body = bodies[i]
            none = np.zeros_like(body.angular_rate)
            force = Force(joint.name, sign * (x @ joint.directions), at, none, source)
            bodies[i] = body._replace(forces=(*body.forces, force))
    return bodies


def _equations(bodies: list[FreeBody], size: float) -> np.ndarray:
    """Forces, and moments divided by a length, of all bodies in one vector."""
    rows = [[b.force, np.atleast_1d(b.moment) / size] if b.rigid else [b.force] for b in bodies]
    return np.concatenate([x for row in rows for x in row])


def _residual(bodies: list[FreeBody]) -> tuple[float, float]:
    """The largest force, and how far forces and moments are off balance."""
    inertial = [np.linalg.norm(b.m * b.acceleration) for b in bodies]
    forces = [np.linalg.norm(f.force) for b in bodies for f in b.forces]
    largest = float(max(*inertial, *forces, 0.0))
    off = max(np.linalg.norm(b.force - b.m * b.acceleration) for b in bodies)
    # m a of a body may be only rounding of its terms, as for a free particle in polar coordinates.
    scale = max(largest, *(b.inertial[0] for b in bodies))
    residual = off / scale if scale else 0.0
    rigid = [b for b in bodies if b.rigid]
    moments = [np.linalg.norm(f.moment(b.centre)) for b in rigid for f in b.forces]
    moments += [b.inertial[1] for b in rigid]
    if moments and max(moments):
        turning = max(np.linalg.norm(b.moment - b.angular_rate) for b in rigid)
        # The moment of a force through the mass centre is only rounding of its arm.
        arms = [np.abs(f.at - b.centre).max() for b in rigid for f in b.forces]
        scale = max(*moments, largest * max(arms, default=0.0))
        residual = max(residual, turning / scale)
    return largest, float(residual)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(...) moments of (..., d) forces in the plane, and 0 on a line; (..., 3) in space."""
    if a.shape[-1] == 3:
        return np.cross(a, b)
    if a.shape[-1] == 2:
        return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
    return np.zeros(a.shape[:-1])
