"""The points of a family of equilibria, and the family itself."""

import collections
import dataclasses
import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _labelled, _text
from jaxdyn._labelled import Labelled, Values, entries
from jaxdyn.analysis.eigenvalues import Eigenvalues, is_centre, rate_eigenvalues, rate_verdict
from jaxdyn.analysis.energy_extremum import is_extremum_of_energy
from jaxdyn.continuation.defining import Make, slope_at
from jaxdyn.continuation.kinds import CodimensionTwo, Kind

_ZERO = 1e-6  # part of the frequency: another eigenvalue of a Hopf point below it counts as 0


@dataclasses.dataclass(frozen=True)
class Equilibrium:
    """An equilibrium of a family.

    Attributes:
      state: (k,) the equilibrium.
      parameter: value of the parameter.
      slopes: (k, k + 1) derivative of the rate with respect to the state and the parameter.
      eigenvalues: eigenvalues of the Jacobian, with bars.
      verdict: "stable", "unstable" or "undecided", as `jaxdyn.linearize` says.
      tangent: (k + 1,) unit vector along the family, the parameter last.
      residual: largest entry of the residual of the point's equations, which at a special point are
        those of its kind.
      kind: kind of special point, if it is one.
      coefficient: at a fold the quadratic coefficient (0 at a cusp), at a Hopf point the first
        Lyapunov coefficient (0 at a Bautin point); at a branch point the quadratic coefficient,
        which is 0 at a pitchfork; NaN elsewhere, and at a zero-Hopf point, where the Lyapunov
        coefficient has a pole.
      cubic: the cubic coefficient at a fold and at a branch point; NaN elsewhere. Both are those of
        z' = a z^2 + c z^3, or if `is_double` of z'' = a z^2 + c z^3.
      frequency: frequency of the small oscillations at a Hopf point [rad per time]; NaN elsewhere.
      units: (k + 2,) units of the state's entries, of the parameter and of time, in which the
        family is followed; `residual` is in these. None in a file of an earlier version.
      is_double: whether the eigenvalue 0 of a fold or branch point is double, as in conservative
        scenes.
    """

    state: np.ndarray
    parameter: float
    slopes: np.ndarray
    eigenvalues: Eigenvalues
    verdict: str
    tangent: np.ndarray
    residual: float
    kind: Kind | None = None
    coefficient: float = math.nan
    cubic: float = math.nan
    frequency: float = math.nan
    units: np.ndarray | None = None
    is_double: bool = False

    @property
    def x(self) -> np.ndarray:
        """(k + 1,) state and parameter."""
        return np.append(self.state, self.parameter)

    @property
    def jacobian(self) -> np.ndarray:
        """(k, k) derivative of the rate with respect to the state."""
        return self.slopes[:, :-1]

    @property
    def criticality(self) -> str:
        """At a Hopf point and a pitchfork "supercritical" or "subcritical", "" elsewhere."""
        if self.kind == Kind.HOPF:
            decisive = self.coefficient
        else:
            decisive = self.cubic if self._is_pitchfork else math.nan
        if not abs(decisive) > 0:
            return ""
        return "supercritical" if decisive < 0 else "subcritical"

    @property
    def _is_pitchfork(self) -> bool:
        return self.kind == Kind.BRANCH and self.coefficient == 0

    @property
    def is_zero_hopf(self) -> bool:
        """Whether it is a Hopf point at which another eigenvalue is 0, so that a fold is there."""
        if self.kind != Kind.HOPF:
            return False
        return bool(np.abs(self.eigenvalues.values).min() <= _ZERO * self.frequency)

    @property
    def name(self) -> str:
        """What it is, as "supercritical Hopf point" or "fold"; "equilibrium" if not special."""
        if self.is_zero_hopf:
            return str(CodimensionTwo.ZERO_HOPF)
        kind = "pitchfork" if self._is_pitchfork else self.kind or "equilibrium"
        return " ".join(filter(None, (self.criticality, kind)))

    @_text.never_raising
    def __repr__(self) -> str:
        rows = [("parameter", _text.brief(self.parameter)), ("state", _text.brief(self.state))]
        numbers = ("coefficient", "cubic", "frequency")
        known = ((name, getattr(self, name)) for name in numbers)
        rows += [(name, _text.brief(x)) for name, x in known if not math.isnan(x)]
        undecided = self.verdict == "undecided"
        rows.append(("stability", self.verdict + " to first order" * undecided))
        return _text.table(f"{self.name[0].upper()}{self.name[1:]}", rows)

    _repr_html_ = _text.html


@dataclasses.dataclass(frozen=True)
class EquilibriumFamily:
    """The equilibria of a family, in order.

    Attributes:
      members: the equilibria, one for each step.
      special: folds, branch points and Hopf points between them.
      end: why it ends.
      make: parameter -> scene.
    """

    members: tuple[Equilibrium, ...]
    special: tuple[Equilibrium, ...]
    end: str
    make: Make

    @_text.never_raising
    def __repr__(self) -> str:
        verdicts = collections.Counter(member.verdict for member in self.members)
        special = [f"{x.name} at {_text.brief(x.parameter)}" for x in self.special]
        rows = [
            ("parameter", _text.extent(self.parameters)),
            ("stability", ", ".join(f"{n} {verdict}" for verdict, n in verdicts.items())),
            ("special", ", ".join(special)),
            ("end", self.end),
        ]
        return _text.table(
            f"Family of {_text.number_of(len(self.members), 'equilibrium', 'equilibria')}", rows
        )

    @_text.with_picture
    def _repr_html_(self):
        from jaxdyn.drawing import bifurcations

        return bifurcations.equilibria([self], title="")

    to_pandas = _labelled.to_pandas
    to_xarray = _labelled.to_xarray

    def _to_labelled(self) -> Labelled:
        labels, axes = self.make(self.members[0].parameter).labels(), ("member",)
        return Labelled(
            {"parameter": Values(axes, self.parameters)},
            {
                **entries(axes, self.states, labels),
                "verdict": Values(axes, [member.verdict for member in self.members]),
            },
        )

    @property
    def parameters(self) -> np.ndarray:
        """(n,) parameters of the members."""
        return np.array([member.parameter for member in self.members])

    @property
    def states(self) -> np.ndarray:
        """(n, k) states of the members."""
        return np.array([member.state for member in self.members])


def equilibrium_at(make: Make, x: np.ndarray, along: np.ndarray, residual: float) -> Equilibrium:
    """The record of a point, with its tangent oriented along `along`."""
    slopes = np.asarray(slope_at(make, x))
    tangent = np.linalg.svd(slopes)[2][-1]
    found = rate_eigenvalues(slopes[:, :-1])
    is_extremum = is_centre(found) and _is_extremum_of_energy(make, x)
    return Equilibrium(
        state=x[:-1],
        parameter=float(x[-1]),
        slopes=slopes,
        eigenvalues=found,
        verdict="stable" if is_extremum else str(rate_verdict(found)),
        tangent=tangent if tangent @ along >= 0 else -tangent,
        residual=residual,
    )


@eqx.filter_jit
def _is_extremum_of_energy(make: Make, x: Array) -> Array:
    """Whether () the energy of the scene in units is conserved and has an extremum at a point."""
    zero, one = jnp.zeros(()), jnp.ones(())
    return is_extremum_of_energy(make(x[-1]), zero, x[:-1], jnp.ones_like(x[:-1]), one)
