"""The equations of a mechanism whose coordinates follow from a few free ones, as in a linkage.

The `opened_form` has constraints phi(q, s) = 0 of the free coordinates q and the followers s.
Their velocities and accelerations follow with ratios kappa,

    s' = kappa q',    s'' = kappa q'' + sigma,    kappa = -(dphi/ds)^-1 dphi/dq,

and with Lagrange's equations of the opened form, M_qq q'' + M_qs s'' = h_q and M_sq q'' + M_ss s''
= h_s, adding kappa^T times the second equation to the first eliminates the multipliers:

    (M_qq + M_qs kappa + kappa^T M_sq + kappa^T M_ss kappa) q'' = h_q + kappa^T h_s - (M_qs +
        kappa^T M_ss) sigma.

kappa and sigma have names, so that the printed equations stay short.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxdyn.scene import Scene
from jaxdyn.symbolic.algebra import Expression, Symbol, as_expression, number, total
from jaxdyn.symbolic.simplifying import simplify
from jaxdyn.symbolic.symbols import Symbols, moving_coordinate


class Followers(NamedTuple):
    """Coordinates that follow from the free ones, and the expressions for their derivatives.

    Attributes:
      coordinates: the symbols of the followers.
      place: (t, y) -> their values at a state.
      slopes: for each follower, its derivatives with respect to the free coordinates, by the
        symbols of these.
      definitions: definitions of the ratios, the velocities of the followers, and the parts of
        their accelerations that depend on velocities, each in terms of the previous ones.
      accelerations: accelerations of the followers in terms of these.
    """

    coordinates: tuple[Symbol, ...]
    place: Callable[[Any, Any], Sequence[float]]
    slopes: dict[Symbol, dict[Symbol, Expression]]
    definitions: tuple[tuple[Symbol, Expression], ...]
    accelerations: tuple[tuple[Symbol, Expression], ...]

    def values(self, t: float, y: np.ndarray) -> dict[Symbol, float]:
        """The values of the followers at a state."""
        found = np.asarray(self.place(jnp.asarray(t), jnp.asarray(y)), float)
        return dict(zip(self.coordinates, found.tolist(), strict=True))

    def slope(self, x: Expression, by: Symbol) -> Expression:
        """The derivative by an entry of the state, through followers and their ratios too."""
        defined = dict(self.definitions)
        found = x.differentiate(by)
        for s in x.symbols():
            if s in self.slopes:
                found = found + x.differentiate(s) * self.slopes[s].get(by, number(0))
            elif s in defined:
                found = found + x.differentiate(s) * self.slope(defined[s], by)
        return found


class OpenedCoordinates(NamedTuple):
    """The coordinates of an opened mechanism: the free ones, then the followers.

    Attributes:
      q: symbols of all coordinates.
      v: symbols of their velocities.
      a: symbols of their accelerations.
      free: number of free coordinates.
    """

    q: tuple[Symbol, ...]
    v: tuple[Symbol, ...]
    a: tuple[Symbol, ...]
    free: int

    @property
    def followers(self) -> tuple[list[Symbol], list[Symbol]]:
        """The symbols of the followers, and of their velocities."""
        return list(self.q[self.free :]), list(self.v[self.free :])


def opened_coordinates(scene: Scene, found: Symbols) -> OpenedCoordinates:
    """The coordinates of the opened form of a scene's mechanism, by their names there."""
    system: Any = scene.system
    names = [name for name, _ in system.mechanism.opened_form().mechanism.coordinates()]
    n = len(found.coordinates)
    others = [moving_coordinate(name, n + i) for i, name in enumerate(names[n:])]
    more = zip(*others, strict=True)
    known = (found.coordinates, found.state[n:], found.unknowns)
    q, v, a = ((*of, *extra) for of, extra in zip(known, more, strict=True))
    return OpenedCoordinates(q, v, a, n)


def find_followers(
    scene: Scene, all_: OpenedCoordinates, ties: Sequence[Expression], second: Sequence[Expression]
) -> Followers:
    """The followers that constraints determine.

    Args:
      scene: the scene of the mechanism.
      all_: its coordinates.
      ties: the constraints, sums that are zero.
      second: the same, differentiated twice.
    """
    n = all_.free
    q, s = all_.q[:n], all_.q[n:]
    inverse = _inverse([[x.differentiate(of) for of in s] for x in ties])
    at_rest = dict.fromkeys(all_.a, number(0))
    kappas, sigmas, slopes = [], [], {}
    for k, follower in enumerate(s):
        columns = [[x.differentiate(of) for x in ties] for of in q]
        index = follower.index or follower.name
        several = [str(i + 1) if n > 1 else "" for i in range(n)]
        ratios = [_short("kappa", f"{index}{i}", k) for i in several]
        values = [_minus_product(inverse[k], column) for column in columns]
        kappas += list(zip(ratios, values, strict=True))
        slopes[follower] = dict(zip(q, map(as_expression, ratios), strict=True))
        sigma = _minus_product(inverse[k], [x.replace(at_rest.get) for x in second])
        sigmas.append((_short("sigma", index, len(s) + k), sigma))
    speeds = [
        (v, total(slopes[follower][x] * u for x, u in zip(q, all_.v[:n], strict=True)))
        for follower, v in zip(s, all_.v[n:], strict=True)
    ]
    seconds = [
        (a, total(slopes[follower][x] * u for x, u in zip(q, all_.a[:n], strict=True)) + sigma)
        for follower, a, (sigma, _) in zip(s, all_.a[n:], sigmas, strict=True)
    ]
    place = scene.system.mechanism.opened_form().place

    def placed(t, y):
        return place(t, y[:n])[n:]

    return Followers(tuple(s), placed, slopes, (*kappas, *speeds, *sigmas), tuple(seconds))


def eliminate_followers(
    all_: OpenedCoordinates, found: Followers, laws: Sequence[Expression]
) -> tuple[Expression, ...]:
    """The equations of the free coordinates alone, from those of all.

    Args:
      all_: the coordinates.
      found: the followers.
      laws: for each coordinate, a sum that is zero up to the constraint forces.
    """
    n = all_.free
    followed = dict(found.accelerations)
    of_all = [x.replace(followed.get) for x in laws]
    return tuple(
        simplify(
            of_all[i]
            + total(
                found.slopes[follower][x] * of_all[n + k]
                for k, follower in enumerate(found.coordinates)
            )
        )
        for i, x in enumerate(all_.q[:n])
    )


def _short(stem: str, index: str, rank: float) -> Symbol:
    return Symbol(stem + index, "short", stem=stem, index=index, rank=rank)


def _minus_product(row: Sequence[Expression], column: Sequence[Expression]) -> Expression:
    """Minus the product of a row of the inverse with a column."""
    return simplify(-total(a * b for a, b in zip(row, column, strict=True)))


def _inverse(matrix: list[list[Expression]]) -> list[list[Expression]]:
    """The inverse of a square matrix, by its minors."""
    n = len(matrix)
    whole = simplify(_determinant(matrix))
    return [
        [_determinant(_without(matrix, i, j)) * (-1) ** (i + j) / whole for i in range(n)]
        for j in range(n)
    ]


def _determinant(matrix: list[list[Expression]]) -> Expression:
    if not matrix:
        return number(1)
    return total(
        matrix[0][j] * _determinant(_without(matrix, 0, j)) * (-1) ** j for j in range(len(matrix))
    )


def _without(matrix: list[list[Expression]], i: int, j: int) -> list[list[Expression]]:
    return [[*row[:j], *row[j + 1 :]] for k, row in enumerate(matrix) if k != i]
