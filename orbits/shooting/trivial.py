"""The directions in which integrals and symmetries make an orbit's multipliers 1.

An integral I with gradient w satisfies w M = w, a symmetry with generator g satisfies M g = g.
Candidates come from the scene (`analysis.energy.integrals`, translations, rotations) and from the
flow, and are confirmed in two ways: by these equations on the monodromy matrix M itself, and by the
vector field f at points off the orbit, where w f = 0 and g commutes with f. (Where M is the unit
matrix, as for an oscillator, the first test alone would confirm every candidate.)

Where the flow preserves a symplectic form J, M^T J M = J, and each direction confirms another one
(Noether's theorem): from M g = g follows (J^T g) M = J^T g, and from w M = w follows
M J^-T w = J^-T w. So the flow itself confirms an energy that the scene does not name.

All norms are those of states in units of their sizes along the motion.

In the axes that turn with a relative orbit, M rotates the momenta into each other, and likewise the
translations: they are confirmed together, and have the multipliers exp(+-i angle).

M is split by these directions into blocks. The computed directions are not exactly those of M:
near an equilibrium rates and gradients are differences of nearly equal numbers. `Split.residual`
is how far M is from having the blocks: its distance from a matrix that has them exactly.
"""

import contextlib
import dataclasses
import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn.analysis.eigenvalues import ERROR_SAFETY
from jaxdyn.analysis.energy import integrals
from jaxdyn.analysis.monodromy import form_change

#: Relative error to which M must preserve a candidate that is confirmed.
CONFIRMED = 1e-7
#: The same for the flow. If the field does not depend on time, M fails to preserve the direction of
#: the flow only by M's own error, which the error bars include (`Split.residual`).
_CONFIRMED_FLOW = 1e-4
_FLOW = "flow"
#: The same for the vector field off the orbit, where nothing is integrated and errors are rounding.
_EXACT = 1e-12
#: Singular values of a set of directions below this share of the largest are rounding.
RANK = 1e-7
#: Distances of the points off the orbit, relative to each entry of the start. The nearer ones are
#: for scenes that are not defined everywhere (negative populations): points with NaN are ignored.
_DISTANCES_OFF = 0.1, 0.01, 0.001
#: The least size attributed to an entry of the start, relative to its size along the motion.
_LEAST_ENTRY = 0.01
#: A unit vector nearer than this to the span of others counts as dependent on them.
_ANOTHER = 1e-4
#: Relative change of a direction by the rotation of a relative orbit up to which the direction
#: counts as unchanged.
_TURNED = 1e-9
#: Prefix of the names of integrals that follow from symmetries by a symplectic form.
_BY_FORM = "integral of "


class _Local(NamedTuple):
    """The candidates and the vector field f at one state, with derivatives.

    Attributes:
      rate: (k,) f.
      still: (k,) f minus its value at time 0.
      slope: (k, k) derivative of f with respect to the state.
      gradients: (..., k) derivatives of each candidate for an integral with respect to the state.
      changes: (...) the rate of change of each along f.
      moves: (k,) each candidate for a symmetry.
      shears: (k,) the rate of change of each along f.
    """

    rate: Array
    still: Array
    slope: Array
    gradients: dict[str, Array]
    changes: dict[str, Array]
    moves: dict[str, Array]
    shears: dict[str, Array]


class Split(NamedTuple):
    """An orthonormal basis [a, q, b] in which a monodromy matrix M (d, d) is block triangular.

    The columns of a span the symmetries tangent to the common level set of the integrals, and those
    of [a, q] the tangent space of this set.

    Attributes:
      a: (d, g) directions of the symmetries.
      q: (d, p) the other directions in the level set, which have the non-trivial multipliers.
      b: (d, n) directions out of the level set.
      reasons: names of the integrals and symmetries that were confirmed.
      turned: multipliers of the directions that were confirmed together.
    """

    a: np.ndarray
    q: np.ndarray
    b: np.ndarray
    reasons: tuple[str, ...]
    turned: np.ndarray

    def residual(self, m: np.ndarray) -> float:
        """The norm of the part of M below the blocks, which is zero in exact arithmetic."""
        inside = np.hstack([self.a, self.q])
        below = self.b.T @ m @ inside, self.q.T @ m @ self.a
        return float(np.sqrt(sum(np.sum(x * x) for x in below)))

    def conditions(self, m: np.ndarray, values: np.ndarray) -> np.ndarray:
        """(p,) condition numbers of the eigenvalues (p,) of q^T M q as eigenvalues of M.

        They are larger than the condition numbers within the block, since a change of M also moves
        an eigenvalue through the other blocks. They are infinite for a multiple eigenvalue, and for
        one that another block has as well.
        """
        a, q, b = self.a, self.q, self.b
        known, right = np.linalg.eig(q.T @ m @ q)
        found = np.full(len(known), np.inf)
        with contextlib.suppress(np.linalg.LinAlgError):
            left = np.linalg.inv(right)
            for i, value in enumerate(values):
                j = np.argmin(np.abs(known - value))
                above = a.T @ m @ a - value * np.eye(a.shape[1])
                below = b.T @ m @ b - value * np.eye(b.shape[1])
                x = np.linalg.solve(above, -a.T @ m @ q @ right[:, j])
                y = np.linalg.solve(below.T, -(left[j] @ q.T @ m @ b))
                lengths = [np.linalg.norm(v) for v in (x, right[:, j], y, left[j])]
                found[i] = math.hypot(*lengths[:2]) * math.hypot(*lengths[2:])
        return found


@dataclasses.dataclass
class _Confirmed:
    """Unit vectors (d,) that M maps to themselves, their names, and the rejected candidates."""

    known: list[np.ndarray]
    names: list[str]
    others: list[np.ndarray]

    def add(self, name: str, vector: np.ndarray) -> None:
        self.known.append(vector / np.linalg.norm(vector))
        self.names.append(name)

    def independent(self, vector: np.ndarray) -> bool:
        """Whether a vector is not a linear combination of the known ones."""
        unit = vector / np.linalg.norm(vector)
        if self.known:
            of = np.array(self.known)
            unit = unit - (unit @ np.linalg.pinv(of, RANK)) @ of
        return bool(np.linalg.norm(unit) > _ANOTHER)


@dataclasses.dataclass(frozen=True)
class Monodromy:
    """The monodromy matrix of an orbit, with the data that confirm its directions.

    Attributes:
      scene: the scene of the orbit.
      m: (d, d) the matrix M in a basis of states in sizes, without NaN.
      error: estimate of the norm of its error.
      basis: (k, d) that basis, orthonormal.
      entry_sizes: (k,) the sizes.
      ahead: (k,) the state one period later for a relative orbit; the start for any other.
      back: (k, k) the map in sizes from states there to states here, the first factor of M; None
        where it is the identity.
      form: (d, d) a symplectic form that M preserves; None if none is known.
      along: (k, n) directions along a family, in which M changes by a multiple of symmetries.
    """

    scene: Scene
    m: np.ndarray
    error: float
    basis: np.ndarray
    entry_sizes: np.ndarray
    ahead: np.ndarray
    back: np.ndarray | None
    form: np.ndarray | None
    along: np.ndarray

    def split(self) -> Split:
        """The split of M by all integrals and symmetries that are confirmed."""
        rows, moves = self._integrals(), self._symmetries()
        if self.form is not None:
            noether = [(f"{_BY_FORM}{name}", self.form.T @ g) for name, g in _pairs(moves)]
            back = np.linalg.pinv(self.form.T)
            partners = [(f"symmetry of {name}", back @ w) for name, w in _pairs(rows)]
            for found, more in ((rows, noether), (moves, partners)):
                for name, vector in more:
                    if found.independent(vector):
                        found.add(name, vector)
        together, turned = self._together(rows.others, self.m)
        nothing = [np.zeros(len(self.m))]
        _, s, vt = np.linalg.svd(np.array([*nothing, *rows.known, *together]))
        outside, kernel = vt[: _rank(s)].T, vt[_rank(s) :].T
        self._add_family(moves)
        together, shifted = self._together(moves.others, self.m.T)
        # A symmetry may change an integral (a rotation changes a non-zero momentum): only the
        # combinations that are tangent to the level set count.
        g = np.array([*nothing, *moves.known, *together]).T
        off = g - kernel @ (kernel.T @ g)
        _, s, vt = np.linalg.svd(off)
        tangent = g @ vt[int((s > RANK).sum()) :].T
        u, s, _ = np.linalg.svd(kernel.T @ tangent)
        inside = _rank(s)
        return Split(
            a=kernel @ u[:, :inside],
            q=kernel @ u[:, inside:],
            b=outside,
            reasons=(*rows.names, *moves.names),
            turned=np.concatenate([turned, shifted]),
        )

    def _integrals(self) -> _Confirmed:
        """The integrals' gradients."""
        scene, entry_sizes, k = self.scene, self.entry_sizes, len(self.entry_sizes)
        found = _Confirmed([], [], [])
        leaks = _largest(_leaks, _nearby(scene, entry_sizes), entry_sizes)
        here = _local_on_host(scene, 0.0, np.asarray(scene.y0)).gradients
        there = here if self.back is None else _local_on_host(scene, 0.0, self.ahead).gradients
        for name, several in here.items():
            leak = leaks[name].reshape(-1)
            later = there[name].reshape(-1, k) * entry_sizes
            for i, w in enumerate(several.reshape(-1, k) * entry_sizes):
                row = w @ self.basis
                same = self.back is None or _is_unturned(w @ self.back, later[i])
                if leak[i] < _EXACT and same and self._keeps(row @ self.m - row, row):
                    found.add(name if several.ndim == 1 else f"{name} {'xyz'[i]}", row)
                elif leak[i] < _EXACT:
                    found.others.append(row / np.linalg.norm(row))
        return found

    def _symmetries(self) -> _Confirmed:
        """The symmetries' generators."""
        found = _Confirmed([], [], [])
        back = self.back
        later = {} if back is None else directions(self.scene, jnp.asarray(self.ahead))
        for name, move in symmetries(self.scene, self.entry_sizes).items():
            g = self.basis.T @ (move / self.entry_sizes)
            same = (
                back is None
                or name not in later
                or _is_unturned(
                    back @ (np.asarray(later[name]) / self.entry_sizes), move / self.entry_sizes
                )
            )
            within = _CONFIRMED_FLOW if name == _FLOW else CONFIRMED
            if same and self._keeps(self.m @ g - g, g, within):
                found.add(name, g)
            elif np.linalg.norm(g) > 0:
                found.others.append(g / np.linalg.norm(g))
        return found

    def _add_family(self, moves: _Confirmed) -> None:
        """Add directions along a family."""
        rows = np.array([np.zeros(len(self.m)), *moves.known])
        symmetric = np.linalg.pinv(rows, RANK) @ rows
        for v in (self.basis.T @ (self.along / self.entry_sizes[:, None])).T:
            change = self.m @ v - v
            if self._keeps(change - symmetric @ change, v):
                moves.add("family", v)

    def _keeps(self, change: np.ndarray, direction: np.ndarray, within: float = CONFIRMED) -> bool:
        size = np.linalg.norm(direction)
        most = max(within * float(np.linalg.norm(self.m)), ERROR_SAFETY * self.error)
        return bool(size > 0 and np.linalg.norm(change) < most * size)

    def _together(
        self, rows: list[np.ndarray], m: np.ndarray
    ) -> tuple[list[np.ndarray], np.ndarray]:
        """The unit rows and their multipliers if their span is invariant under m; else none.

        The matrix m multiplies rows from the right.
        """
        if len(rows) > 1:
            a = np.array(rows)
            block = a @ m @ np.linalg.pinv(a, RANK)
            off = a @ m - block @ a
            if all(self._keeps(change, row) for change, row in zip(off, a, strict=True)):
                return rows, np.linalg.eigvals(block)
        return [], np.zeros(0)


def _pairs(found: _Confirmed) -> list[tuple[str, np.ndarray]]:
    return list(zip(found.names, found.known, strict=True))


def _is_unturned(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.linalg.norm(a - b) <= _TURNED * np.linalg.norm(b))


def count_unnamed(reasons: Iterable[str]) -> int:
    """Number of confirmed integrals that symmetries imply, but that the scene does not name."""
    return sum(name.startswith(_BY_FORM) for name in reasons)


def symmetries(scene: Scene, entry_sizes: np.ndarray) -> dict[str, Any]:
    """Directions (k,) at the scene's start that commute with the vector field, the flow's first.

    They are tested on the vector field alone. The flow of a field that depends on time is left out.
    """
    y0 = np.asarray(scene.y0)
    here = _local_on_host(scene, 0.0, y0)
    leaks = _largest(_commutators, _nearby(scene, entry_sizes), entry_sizes)
    candidates = {_FLOW: here.rate, **here.moves}
    return {name: g for name, g in candidates.items() if leaks[name] < _EXACT}


def _rank(s: np.ndarray) -> int:
    return int((s > RANK * s.max(initial=0.0)).sum())


def keeps_form(scene: Scene, entry_sizes: np.ndarray) -> bool:
    """Whether the flow preserves the symplectic form of the scene's canonical coordinates."""
    project = scene.system.project
    changes = [
        form_change(scene, t, project(t, y), entry_sizes) for t, y in _places(scene, entry_sizes)
    ]
    # If every change is NaN, nothing is known, and the comparison is False.
    return bool(np.fmax.reduce(changes) < _EXACT)


def _nearby(scene: Scene, entry_sizes: np.ndarray) -> list[_Local]:
    """The candidates at a few times and states in general position near the start."""
    return [_local_on_host(scene, t, y) for t, y in _places(scene, entry_sizes)]


def _places(scene: Scene, entry_sizes: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    random, y0 = np.random.default_rng(0), np.asarray(scene.y0)
    size = np.maximum(np.abs(y0), _LEAST_ENTRY * entry_sizes)
    count = len(_DISTANCES_OFF)
    noise = np.outer(_DISTANCES_OFF, size) * random.standard_normal((count, len(y0)))
    ts = random.uniform(0.0, float(scene.t1), count)
    return list(zip(ts, y0 + noise, strict=True))


def _candidates(scene: Scene, t, y: Array) -> dict[str, Array]:
    """Candidates for integrals: energy, momenta, and the momentum conjugate to each coordinate."""
    found = integrals(scene, t, y)
    canonical = scene.system.canonical(t, y)
    if canonical is not None:
        labels, n = scene.system.labels(), len(y) // 2
        found |= {f"momentum of {labels[i][0]}": canonical[n + i] for i in range(n)}
    return found


def directions(scene: Scene, y: Array) -> dict[str, Array]:
    """Candidates for symmetries: those of space, and a shift of each entry of the state."""
    shifts = jnp.eye(len(y))
    names = (name for name, _ in scene.system.labels())
    candidates = {f"shift of {name}": shifts[i] for i, name in enumerate(names)}
    return candidates | scene.system.generators(y)


@jax.jit
def _local(scene: Scene, t, y: Array) -> _Local:
    """The candidates at the state nearest to y that satisfies the constraints.

    This is one small program for all points; the norms and ratios are left to NumPy.
    """
    y = scene.system.project(t, y)
    f, slope = scene.rate(t, y), jax.jacfwd(scene.rate, argnums=1)(t, y)
    slopes = jax.jacfwd(lambda *at: _candidates(scene, *at), argnums=(0, 1))(t, y)
    moves, shears = jax.jvp(lambda y: directions(scene, y), (y,), (f,))
    return _Local(
        rate=f,
        still=f - scene.rate(jnp.zeros(()), y),
        slope=slope,
        gradients={name: by_y for name, (_, by_y) in slopes.items()},
        changes={name: by_t + by_y @ f for name, (by_t, by_y) in slopes.items()},
        moves=moves,
        shears=shears,
    )


def _local_on_host(scene: Scene, t, y: np.ndarray) -> _Local:
    """`_local` on the host."""
    return jax.tree.map(np.asarray, _local(scene, np.asarray(t, float), y))


def _leaks(at: _Local, entry_sizes: np.ndarray) -> dict[str, np.ndarray]:
    """(...) each candidate's relative rate of change, |w f| / (|w| |f|): 0 if it is conserved."""
    size = np.linalg.norm(at.rate / entry_sizes)
    return {
        name: np.abs(at.changes[name]) / (np.linalg.norm(rows * entry_sizes, axis=-1) * size)
        for name, rows in at.gradients.items()
    }


def _commutators(at: _Local, entry_sizes: np.ndarray) -> dict[str, Any]:
    """() each direction's commutator with f, relative to its two terms: 0 for a symmetry."""
    slope, found = np.linalg.norm(at.slope * entry_sizes / entry_sizes[:, None]), {}
    for name, g in at.moves.items():
        shear = at.shears[name]
        size = np.linalg.norm(shear / entry_sizes) + slope * np.linalg.norm(g / entry_sizes)
        found[name] = np.linalg.norm((shear - at.slope @ g) / entry_sizes) / size
    still = np.linalg.norm(at.still / entry_sizes) / np.linalg.norm(at.rate / entry_sizes)
    return {_FLOW: still, **found}


def _largest(
    measure: Callable, nearby: list[_Local], entry_sizes: np.ndarray
) -> dict[str, np.ndarray]:
    """The largest value of a measure for each name over several points, NaN ignored."""
    with np.errstate(invalid="ignore", divide="ignore"):
        found = [measure(at, entry_sizes) for at in nearby]
    return {name: np.fmax.reduce([leaks[name] for leaks in found]) for name in found[0]}
