"""Floquet multipliers with error bars, with the unit multipliers separated.

Every integral and every continuous symmetry of a scene forces a multiplier to be exactly 1,
and an autonomous flow has one more along itself. In a conservative scene they come in
defective pairs, so an eigenvalue solver returns them only to the square root of the rounding, and
the test |multiplier| > 1 would be random. They are removed first, as a block.

`trivial` finds those directions. M maps the common kernel N of the integrals' gradients to
itself, and the symmetries' generators inside it, G, to themselves. The eigenvalues of the quotient,
M on N / G, are exactly the non-trivial multipliers, well conditioned unless two of them meet.
Where the scene is conservative, M is symplectic. This is known better than M itself, since it is
proved from the rate, and the multipliers then come in pairs (`pair_reciprocals`).

Each multiplier gets an error bar (see `jaxdyn.analysis.eigenvalues`), from the change of M between
two tolerances and its rounding. If these bars decide nothing, as for a multiplier of 1.0036 of an
orbit with close encounters, a third tolerance shows each entry of the error, not just its size.
`map_verdict` of that file then judges the multipliers as "stable", "unstable" or "undecided".
"""

import dataclasses
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from jaxdyn import Scene, Status, _text
from jaxdyn._checks import check_first, check_on_host, fail
from jaxdyn.analysis.eigenvalues import (
    ERROR_SAFETY,
    ROUNDING,
    Eigenvalues,
    bound_by_product,
    map_eigenvalues,
    map_in_units,
    map_verdict,
    norm,
    pair_reciprocals,
    with_bars,
)
from jaxdyn.analysis.monodromy import (
    SYMPLECTIC,
    coarser,
    invariant_form,
    symplectic_defect,
    symplectic_form,
    uncertainty,
)
from jaxdyn.integrate.trajectory import explanation
from jaxdyn.status import IntegrationError
from orbits.analysis.chain import return_map, transitions, without_flow
from orbits.analysis.monodromy import (
    Returned,
    Segments,
    log_determinant,
    return_in_basis,
    rotation_back,
    tangents,
    tangents_in,
)
from orbits.closing.sizes import sizes
from orbits.hybrid.legs import HybridOrbit
from orbits.orbit import Orbit
from orbits.shooting import trivial

#: A run over the period is replaced by segments where errors grow by more than the first of these,
#: or the end misses the start by more than the second, in sizes.
_GROWN, _APART = 1e4, 1e-6
_CLOSER = 10.0  # the third tolerance, as a multiple of the first
_EXACT_BARS = 1e-11  # bars so narrow that more digits would leave the verdict open as well
_WIDE = (
    "The bars of the multipliers leave open on which side of the unit circle they are, or whether "
    "they have met. More digits decide it, in minutes: orbits.refine(orbit, 30).stability(); where "
    "the closing equations cannot be posed, find the orbit by closing=orbits.reversal(...) first."
)
_OPEN = (
    "Multipliers lie on the unit circle, or meet there, to all digits: linear terms do not decide "
    "the stability. Those that only come very near are told apart by still more digits, such as "
    "orbits.refine(orbit, 60).stability(); an integral or a symmetry that forces them to be there "
    "can be named in the scene (energy=, integrals=)."
)
_NOT_CLOSED = (
    "The motion does not close after the period, so it has no multipliers. Look for the orbit "
    "first: orbits.find(scene, y0, period)."
)
_DOUBTFUL = 1e-2  # relative bar above which a multiplier may be noise: runs may agree by chance
_VAGUE = 0.1  # a multiplier with wider bars may be inside or outside of the unit circle
_LOOSEST = 1e-9  # largest first tolerance of a third run: looser runs may all take the same steps


@dataclasses.dataclass(frozen=True)
class Stability:
    """The linear stability of an orbit.

    Attributes:
      multipliers: (d,) all Floquet multipliers: the non-trivial ones, then for a relative orbit
        those of the centre of mass, exp(+-i angle), then the unit ones. There is one for each
        direction on the constraint surface, so d = k without constraints.
      nontrivial: (p,) the multipliers that no integral, symmetry or flow forces.
      bars: (p,) their error bars.
      unit: number of multipliers that are 1 by an integral, a symmetry or the flow.
      integrals: number of independent integrals that were confirmed.
      reasons: the integrals and symmetries that were confirmed.
      exponents: rotation numbers nu in [0, 1/2] of the non-trivial multipliers
        exp(+-2 pi i nu), one for each pair, None for a real pair.
      verdict: "stable", "unstable" or "undecided".
      symplectic_defect: largest entry of M^T J M - J over |M|^2 and that of J; None where the
        system has no canonical coordinates and no constant form J that its rate preserves is found.
      determinant_defect: |det M - 1|; None likewise.
      monodromy: (d, d) the matrix M, in the basis `tangents`; for a chain of legs, on the
        directions that its closing compares, in units of sizes.
      conservative: whether the rate is proved, to rounding, to preserve a symplectic form.
      growth: norm of the same matrix for states in units of their sizes.
      closes: whether the motion ends near its start; if not, the verdict is "undecided".
      status: status of the integration over the period; unless it is OK, every number is NaN and
        the verdict is "undecided".
    """

    multipliers: np.ndarray
    nontrivial: np.ndarray
    bars: np.ndarray
    unit: int
    integrals: int
    reasons: tuple[str, ...]
    exponents: tuple[float | None, ...]
    verdict: str
    symplectic_defect: float | None
    determinant_defect: float | None
    monodromy: np.ndarray
    conservative: bool = False
    growth: float = math.nan
    closes: bool = True
    status: Status = Status.OK

    @_text.never_raising
    def __repr__(self) -> str:
        known = [nu for nu in self.exponents if nu is not None]
        # Without a symplectic form multipliers do not come in pairs.
        indices = self.indices.tolist() if self.conservative else []
        rows = [
            ("multipliers", with_bars(self.nontrivial, self.bars)),
            ("equal to 1", f"{self.unit}: {', '.join(self.reasons)}" if self.unit else ""),
            ("rotation", ", ".join(f"{nu:.9g}" for nu in known)),
            ("indices", ", ".join(f"{x:.9g}" for x in indices)),
            ("status", "" if self.ok else f"{self.status.name}: {self.message}"),
            ("open", self.message if self.ok and self.verdict == "undecided" else ""),
        ]
        return _text.table(f"Stability: {self.verdict}", rows)

    @_text.with_picture
    def _repr_html_(self):
        from orbits.drawing import unit_circle

        return unit_circle.multipliers(self, title="")

    @property
    def ok(self) -> bool:
        """Whether the motion was integrated over its period."""
        return self.status == Status.OK

    @property
    def indices(self) -> np.ndarray:
        """(p / 2,) stability indices (z + 1 / z) / 2 of the pairs of non-trivial multipliers.

        They lie in [-1, 1] where a pair is on the unit circle, as all pairs of a stable orbit are;
        the largest by absolute value comes first. They are complex where two pairs leave the circle
        together, and mean nothing where multipliers do not come in pairs, as in scenes with
        damping.
        """
        values = 0.5 * (self.nontrivial + 1 / self.nontrivial)
        found, left = [], list(values[np.argsort(-np.abs(values), kind="stable")])
        while left:
            one = left.pop(0)
            if left:
                left.pop(int(np.argmin(np.abs(np.array(left) - one))))
            found.append(one)
        kept = np.array(found, complex)
        real = np.abs(kept.imag) <= _REAL * np.maximum(1.0, np.abs(kept))
        return kept.real if real.all() else kept

    @property
    def unnamed(self) -> int:
        """Number of integrals that the scene does not name, but that its symmetries imply."""
        return trivial.count_unnamed(self.reasons)

    @property
    def message(self) -> str:
        """How the integration ended or what leaves the verdict open, with a remedy."""
        if not self.ok or self.verdict != "undecided":
            return self.status.message
        if not self.closes:
            return _NOT_CLOSED
        return _WIDE if (self.bars > _EXACT_BARS).any() else _OPEN


#: Relative imaginary part of a stability index up to which it is rounding.
_REAL = 1e-9


class _Form(NamedTuple):
    """A symplectic form at the start of an orbit, in a basis of states in sizes.

    Attributes:
      matrix: (d, d) the form; None if none is known.
      defect: how far the monodromy matrix is from keeping it.
      kept: whether the flow preserves the form, and the matrix does so up to its error.
    """

    matrix: np.ndarray | None
    defect: float | None
    kept: bool


@check_first
def stability(
    orbit: Orbit | HybridOrbit,
    *,
    rtol: float | None = None,
    along: np.ndarray | None = None,
    throw: bool = True,
) -> Stability:
    """The multipliers of an orbit, with error bars and a verdict.

    Args:
      orbit: a result of `find` or `find_hybrid`. For a chain of legs the events enter by their
        saltation matrices, and each position that its closing leaves out has a unit multiplier;
        integrals are not looked for.
      rtol: tolerance of the variational equations; the orbit's own by default. A second run at a
        hundred times this tolerance gives the error bars; if these leave the verdict undecided, a
        third run at ten times this tolerance makes them narrower.
      along: (k, p) directions from the start to other orbits of the same scene, which exist because
        of an integral that the scene does not name. Each forces one more multiplier to be 1;
        `continue_family` finds them.
      throw: raise if the motion cannot be integrated over its period at one of the two
        tolerances (a collision, the step limit), or if a chain grazes an event, where it has no
        multipliers; with False check `Stability.status`.
    Raises:
      ValueError: the orbit has traced values; a chain of legs was not found, grazes an event
        (``throw=True``), has constrained states, or has a closing that is not a condition that it
        repeats itself; `along` is given for a chain.
      IntegrationError: the motion cannot be integrated over its period (``throw=True``).
    Limits: linear stability only. "stable" for a conservative scene means all non-trivial
      multipliers lie on the unit circle and cannot leave it within their bars.
    """
    check_on_host("stability", orbit, "See orbits.differentiable(scene, orbit).multipliers().")
    rtol = orbit.rtol if rtol is None else rtol
    if isinstance(orbit, HybridOrbit):
        if along is not None:
            raise fail("along", "None for a chain of legs", "directions", "Leave it out.")
        return _of_chain(orbit, rtol, throw)
    return judge(orbit, None, sizes(orbit.scene), rtol=rtol, along=along, throw=throw)


def judge(
    orbit: Orbit,
    segments: Segments | None,
    entry_sizes: np.ndarray,
    *,
    rtol: float,
    along: np.ndarray | None,
    throw: bool,
) -> Stability:
    """`stability` of an orbit whose segments may be known, with the sizes (k,) of the entries."""
    scene = orbit.scene
    basis = tangents_in(scene, entry_sizes)
    runs = _Runs.of(segments, orbit, rtol, basis, entry_sizes)
    fine, coarse = runs.fine, runs.coarse
    status = max(fine.status, coarse.status)
    if status != Status.OK:
        if throw:
            raise IntegrationError(explanation(status, scene))
        return _unknown_stability(len(fine.m), status)
    m = fine.m
    form = _form(scene, m, float(uncertainty(m, coarse.m, rtol)), basis, entry_sizes)
    split = _split_monodromy(orbit, m, coarse.m, form, basis, entry_sizes, along)
    q = split.q
    reduced = q.T @ m @ q
    # The rounding error is that of the whole matrix, not of the block.
    error = uncertainty(reduced, q.T @ coarse.m @ q, rtol) + (ROUNDING + fine.error) * norm(m)

    def multipliers(*known) -> tuple[Eigenvalues, str]:
        found = _widen(map_eigenvalues(reduced, error, *known), split, m)
        if form.kept:
            found = pair_reciprocals(bound_by_product(found, 0.0))
        elif _is_noise(found, orbit).any():
            found = bound_by_product(found, *runs.log_determinant())
        return found, str(map_verdict(found, form.kept))

    found, verdict = multipliers()
    # Collocation has only two numbers of nodes: a third matrix would be equal to the second.
    if verdict == "undecided" and rtol <= _LOOSEST and orbit.mesh is None:
        closer = runs.at(_CLOSER * rtol)
        changes = [q.T @ (x.m - m) @ q for x in (closer, coarse)]
        found, verdict = multipliers(changes, (rtol + ROUNDING + fine.error) * norm(m))
    nontrivial, bars = found
    unit = len(m) - len(nontrivial) - len(split.turned)
    return Stability(
        multipliers=np.concatenate([nontrivial, split.turned, np.ones(unit)]),
        nontrivial=nontrivial,
        bars=bars,
        unit=unit,
        integrals=split.b.shape[1],
        reasons=split.reasons,
        exponents=rotation_numbers(nontrivial, bars),
        verdict=verdict,
        symplectic_defect=form.defect,
        determinant_defect=None if form.defect is None else float(abs(np.linalg.det(m) - 1)),
        monodromy=_in_entries(scene, m, basis, entry_sizes),
        conservative=form.kept,
        growth=float(norm(m)),
        closes=fine.closes,
    )


def _is_noise(found: Eigenvalues, orbit: Orbit) -> np.ndarray:
    """(p,) whether each multiplier may be noise, and its bar is wider than `_VAGUE`.

    A bar comes from the difference of two runs, which may be small by chance if both are noise.
    For stiff motions `_VAGUE` does not apply: on a slow manifold the rate is a small difference of
    large terms, and rounding of the start changes its direction.
    """
    vague = 0.0 if orbit.stiff else _VAGUE
    return found.bars > np.maximum(vague, _DOUBTFUL * np.abs(found.values))


class _Runs(NamedTuple):
    """The monodromy matrix at several tolerances, by runs over the period or from segments.

    Attributes:
      fine: the matrix at the first tolerance.
      coarse: the matrix at a coarser tolerance.
      at: the matrix at any tolerance.
      log_determinant: computes the logarithm of the matrix's determinant, and its error.
    """

    fine: Returned
    coarse: Returned
    at: Callable[[float], Returned]
    log_determinant: Callable[[], tuple[float, float]]

    @classmethod
    def of(
        cls, segments: Segments | None, orbit: Orbit, rtol: float, basis, entry_sizes
    ) -> "_Runs":
        """The matrices of an orbit, from segments where a run ends far from its start."""
        if segments is not None:
            found = cls._from_segments(segments, rtol, basis, entry_sizes)
            if found is not None:
                return found

        def at(rtol: float) -> Returned:
            return return_in_basis(orbit, rtol, basis, entry_sizes)

        fine = at(rtol)
        if segments is None and orbit.mesh is None and _leaves(fine):
            segments = Segments.of(orbit)
            found = (
                None if segments is None else cls._from_segments(segments, rtol, basis, entry_sizes)
            )
            if found is not None:
                return found
        return cls(fine, at(coarser(rtol)), at, lambda: log_determinant(orbit))

    @classmethod
    def _from_segments(cls, segments: Segments, rtol: float, basis, entry_sizes) -> "_Runs | None":
        """The matrices from segments; None where these do not join at the tolerances."""
        first, second = segments.at(rtol), segments.at(coarser(rtol))
        if first is None or second is None:
            return None

        def at(rtol: float) -> Returned:
            return (segments.at(rtol) or segments).monodromy(basis, entry_sizes)

        fine, coarse = first.monodromy(basis, entry_sizes), second.monodromy(basis, entry_sizes)
        error = abs(fine.log_determinant - coarse.log_determinant) + ROUNDING
        return cls(fine, coarse, at, lambda: (fine.log_determinant, error))


def _leaves(run: Returned) -> bool:
    """Whether a run over the period ends at its limit of steps, or far from the orbit.

    Segments are then better: each has that limit, and they join.
    """
    if run.status != Status.OK:
        return run.status == Status.STEP_LIMIT
    return not (norm(run.m) <= _GROWN and run.gap <= _APART)


_NO_MAP = (
    "The return map of the chain is not finite: a leg runs into a singularity, or its "
    "derivative overflows. Check the legs with `HybridOrbit.trajectory`, or pass a smaller rtol."
)


def _of_chain(orbit: HybridOrbit, rtol: float, throw: bool) -> Stability:
    """The multipliers of a chain of legs."""
    if not orbit.ok:
        got = f"one with the outcome {orbit.outcome.name}"
        raise fail("orbit", "a chain that was found", got, orbit.message)
    if not throw and transitions(orbit, rtol).grazed is not None:
        return _unknown_stability(len(orbit.y0), Status.NOT_FINITE)
    fine, coarse = (return_map(orbit, x) for x in (rtol, coarser(rtol)))
    m = fine.m
    if not (np.isfinite(m).all() and np.isfinite(coarse.m).all()):
        if throw:
            raise IntegrationError(_NO_MAP)
        return _unknown_stability(len(orbit.y0), Status.NOT_FINITE)
    q, flows = without_flow(fine)
    reduced = q.T @ m @ q
    error = uncertainty(reduced, q.T @ coarse.m @ q, rtol) + ROUNDING * norm(m)
    nontrivial, bars = found = map_eigenvalues(reduced, error)
    unit = fine.advances + flows
    free = "advance" if fine.advances == 1 else f"{fine.advances} advances"
    return Stability(
        multipliers=np.concatenate([nontrivial, np.ones(unit)]),
        nontrivial=nontrivial,
        bars=bars,
        unit=unit,
        integrals=0,
        reasons=("flow",) * flows + (free,) * bool(fine.advances),
        exponents=rotation_numbers(nontrivial, bars),
        verdict=str(map_verdict(found, False)),
        symplectic_defect=None,
        determinant_defect=None,
        monodromy=m,
        growth=float(norm(m)),
    )


def _widen(found: Eigenvalues, split: trivial.Split, m: np.ndarray) -> Eigenvalues:
    """The multipliers with bars that include the error in the directions of the split."""
    off, (values, bars) = split.residual(m), found
    if not (off and len(values)):
        return found
    conditions, d = split.conditions(m, values), len(m)
    most = (2 * norm(m)) ** (1 - 1 / d) * (ERROR_SAFETY * off) ** (1 / d)  # Elsner's bound
    return Eigenvalues(values, bars + np.fmin(ERROR_SAFETY * off * conditions, most))


def _split_monodromy(
    orbit: Orbit, m, coarse, form: _Form, basis, entry_sizes, along
) -> trivial.Split:
    """M (d, d) split by its known directions; `coarse` is M at another tolerance."""
    scene, closing = orbit.scene, orbit.closing
    return trivial.Monodromy(
        scene=scene,
        m=m,
        error=float(np.linalg.norm(m - coarse)),
        basis=basis,
        entry_sizes=entry_sizes,
        ahead=closing.after(scene.system, scene.y0, orbit.angle, 1),
        back=map_in_units(rotation_back(orbit), entry_sizes) if closing.turns else None,
        form=form.matrix if form.kept else None,
        along=np.zeros((len(entry_sizes), 0)) if along is None else along,
    ).split()


def _in_entries(
    scene: Scene, m: np.ndarray, basis: np.ndarray, entry_sizes: np.ndarray
) -> np.ndarray:
    """(d, d) a map in the basis `tangents`, from its matrix in a basis of states in sizes."""
    change = tangents(scene, np.asarray(scene.y0)).T @ (basis * entry_sizes[:, None])
    return change @ m @ np.linalg.inv(change)


def _form(
    scene: Scene, m: np.ndarray, error: float, basis: np.ndarray, entry_sizes: np.ndarray
) -> _Form:
    """The form for a map m (d, d) with an error, in a basis of states in the sizes (k,)."""
    form, kept = symplectic_form(scene, scene.y0), True
    if form is not None:
        form = basis.T @ (np.asarray(form) * entry_sizes * entry_sizes[:, None]) @ basis
        kept = trivial.keeps_form(scene, entry_sizes)
    elif basis.shape[1] == len(entry_sizes):  # no constraints
        form = invariant_form(scene, entry_sizes)
    if form is None:
        return _Form(None, None, False)
    form = form / (np.abs(form).max() or 1.0)
    defect = float(symplectic_defect(m, form))
    most = max(SYMPLECTIC, 2 * ERROR_SAFETY * error / max(1.0, float(norm(m))))
    return _Form(form, defect, kept and defect < most)


def _unknown_stability(d: int, status: Status) -> Stability:
    """The result where the motion was not integrated over its period: all NaN."""
    nothing = np.full(d, np.nan)
    return Stability(
        multipliers=nothing.astype(complex),
        nontrivial=nothing.astype(complex),
        bars=nothing,
        unit=0,
        integrals=0,
        reasons=(),
        exponents=(),
        verdict="undecided",
        symplectic_defect=None,
        determinant_defect=None,
        monodromy=np.full((d, d), np.nan),
        status=status,
    )


def rotation_numbers(values: np.ndarray, bars: np.ndarray) -> tuple[float | None, ...]:
    """One rotation number for each pair (lambda, 1 / lambda) or (lambda, conj lambda)."""
    left = list(range(len(values)))
    numbers: list[float | None] = []
    while left:
        i = left.pop(0)
        is_complex = abs(values[i].imag) > bars[i]
        if is_complex:
            partner = np.conj(values[i])
        else:
            partner = 1 / values[i] if values[i] else values[i]
        if left:
            left.pop(int(np.argmin([abs(values[j] - partner) for j in left])))
        numbers.append(float(abs(np.angle(values[i])) / (2 * np.pi)) if is_complex else None)
    return tuple(sorted(numbers, key=lambda nu: (nu is not None, nu or 0.0)))
