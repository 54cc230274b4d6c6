"""The forces of constraints as formulas, by Newton's law for each free body.

The bodies and what holds them are those of `System.bodies` and `System.joints`. A body with only
one unknown joint gives the force in it, and with this the next one has one unknown joint fewer, as
from the tip of a pendulum to its pivot. Closed loops, and bodies held at several places, have no
formulas: the balance of moments would be needed as well, and the result would fill pages.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxdyn.joints import Joint
from jaxdyn.scene import Scene
from jaxdyn.symbolic.algebra import Expression, Group, Symbol, as_expression, number, total
from jaxdyn.symbolic.arranging import split_common
from jaxdyn.symbolic.reading import read
from jaxdyn.symbolic.simplifying import simplify
from jaxdyn.symbolic.symbols import Symbols
from jaxdyn.system import total_force

#: Formulas with more terms, at all depths, are not printed.
_MOST_TERMS = 16
_AXES = "xyz"


class Reaction(NamedTuple):
    """A force of a constraint.

    Attributes:
      symbol: its symbol.
      value: the force, in which forces of other joints and accelerations may occur.
      meaning: what it acts on, and when it is positive.
    """

    symbol: Symbol
    value: Expression
    meaning: str


def reactions_of(
    scene: Scene, found: Symbols, by_time: Callable[[Expression], Expression]
) -> tuple[Reaction, ...]:
    """The forces in the joints of a scene that follow from one body after the other.

    Args:
      scene: a mechanism without multipliers.
      found: its symbols.
      by_time: differentiates an expression with respect to time, along a motion.
    """
    if any("generalized" in effect.acts for effect in scene.effects):
        return ()  # a force on a coordinate has no point of application
    t, y = jnp.zeros(()), jnp.asarray(scene.y0)
    bodies, joints = scene.system.bodies(t, y), scene.system.joints(t, y)
    m, rows = np.asarray(scene.system.points(t, y).m), [np.asarray(j.directions) for j in joints]
    if not joints or not all(np.allclose(x @ x.T, np.eye(len(x))) for x in rows):
        return ()

    def quantities(field, t, y):
        r, v, m = field.system.points(t, y)
        force = total_force(field.effects, t, r, v, m)
        return r, m, force, [joint.directions for joint in field.system.joints(t, y)]

    r, masses, force, *directions = read(scene, found, quantities)
    inertial = [
        [mass * by_time(by_time(x)) - f for x, f in zip(place, on, strict=True)]
        for mass, place, on in zip(masses.tolist(), r.tolist(), force.tolist(), strict=True)
    ]
    # What the joints of each body have to supply.
    needed = [[total(inertial[p][d] for p in b.points) for d in range(r.shape[1])] for b in bodies]
    whole = [np.array_equal(np.asarray(b.m), m[list(b.points)]) for b in bodies]
    named = _symbols([len(x) for x in rows])
    taken = {s.name for s in (*found.state, *found.values)}
    if taken & {str(s.stem) + str(s.index) for row in named for s in row}:
        return ()
    open_, values = set(range(len(joints))), {}
    while True:
        of = {
            b: [i for i in open_ if b in (joints[i].on, joints[i].by)] for b in range(len(bodies))
        }
        ready = [(b, of[b][0]) for b in of if len(of[b]) == 1 and whole[b]]
        if not ready:
            break
        b, i = ready[0]
        joint, axes = joints[i], directions[i].tolist()
        orientation = _orientation(joint) * (1 if joint.on == b else -1)
        for symbol, axis in zip(named[i], axes, strict=True):
            along = total(x * f for x, f in zip(axis, needed[b], strict=True))
            values[symbol] = simplify(orientation * along)
        for other, sign in ((joint.on, _orientation(joint)), (joint.by, -_orientation(joint))):
            if other is not None:
                for symbol, axis in zip(named[i], axes, strict=True):
                    pull = [sign * as_expression(symbol) * x for x in axis]
                    needed[other] = [x - f for x, f in zip(needed[other], pull, strict=True)]
        open_.remove(i)
    reactions = [
        Reaction(symbol, values[symbol], meaning)
        for i, joint in enumerate(joints)
        if i not in open_
        for symbol, meaning in zip(named[i], _meanings(joint, bodies[joint.on].name), strict=True)
    ]
    return tuple(reactions) if all(_terms(one.value) <= _MOST_TERMS for one in reactions) else ()


def _symbols(counts: Sequence[int]) -> list[list[Symbol]]:
    """R, or R1, R2 and so on, for the components in each joint."""
    indices = iter([str(k + 1) if sum(counts) > 1 else "" for k in range(sum(counts))])
    return [
        [Symbol(f"R{k}", "short", stem="R", index=k) for k in itertools.islice(indices, n)]
        for n in counts
    ]


def _orientation(joint: Joint) -> int:
    """-1 for a rod, whose direction is that of a push, while its tension is printed; else 1."""
    return 1 if joint.other is None else -1


def _meanings(joint: Joint, body: str) -> list[str]:
    """What the components of the force in a joint are."""
    if joint.other is not None:
        return [f"tension of the {joint.name}"]
    what, rows = f"force of the {joint.name} on the {body}", np.asarray(joint.directions)
    if len(rows) > 1:
        return [f"{what}, along {axis}" for axis, _ in zip(_AXES, rows, strict=False)]
    k = int(np.abs(rows[0]).argmax())
    side = f"{'+' if rows[0][k] > 0 else '-'}{_AXES[k]}"
    return [f"normal {what}; positive on the side of {side} at the start"]


def _terms(x: Expression) -> int:
    """The number of terms of an expression and of the sums in it."""
    inside = (_terms(a.sum) for m in x.terms for a, _ in m if isinstance(a, Group))
    return len(x.terms) + sum(inside)


def only_multiplier(
    equations: Sequence[Expression],
    unknowns: Sequence[Symbol],
    multiplier: Symbol,
    lengths: Mapping[Expression, Expression],
) -> Expression | None:
    """The value of the only multiplier, if each equation has one highest derivative of its own.

    Args:
      equations: sums that are zero: one for each unknown, and the condition on all of them.
      unknowns: the highest derivatives.
      multiplier: its symbol.
      lengths: known values of the roots of sums.
    """
    *laws, condition = equations
    slopes = [[x.differentiate(s) for s in unknowns] for x in laws]
    if any(bool(x) != (i == j) for i, row in enumerate(slopes) for j, x in enumerate(row)):
        return None
    nothing = dict.fromkeys((*unknowns, multiplier), number(0))
    left, right = number(0), condition.replace(nothing.get)
    for i, (law, s) in enumerate(zip(laws, unknowns, strict=True)):
        per_mass = condition.differentiate(s) / slopes[i][i]
        left = left + per_mass * law.differentiate(multiplier)
        right = right - per_mass * law.replace(nothing.get)
    left, right = simplify(left), simplify(right)
    if not left:
        return None
    for square, length in lengths.items():
        quotient = _quotient(left, square)
        if not (left - quotient * square).expand():
            left = simplify(quotient) * length * length
    content, common, inner = split_common(left)
    found = simplify(right / Expression({common: content}) / inner)
    return found if _terms(found) <= _MOST_TERMS else None


def _quotient(x: Expression, by: Expression) -> Expression:
    """The quotient of a sum by another one of which it is a multiple."""
    first, c = next(iter(by.terms.items()))
    of_first = (m for m in x.terms if all(dict(m).get(a) == e for a, e in first))
    return total(Expression({m: x.terms[m]}) / Expression({first: c}) for m in of_first)
