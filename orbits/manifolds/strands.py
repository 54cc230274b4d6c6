"""A stable or unstable manifold as strands: motions that begin next to an orbit."""

import dataclasses

import numpy as np

from jaxdyn import Scene, Status, _text
from jaxdyn.integrate.trajectory import explanation
from orbits.orbit import Orbit


@dataclasses.dataclass(frozen=True)
class Manifold:
    """Strands of a manifold of a periodic orbit or of an equilibrium.

    Attributes:
      scene: the scene.
      kind: "unstable", or "stable", whose strands run backwards.
      orbit: the orbit, or None.
      base: (n, k) the states beside which strands begin.
      phases: (n,) for each strand, the time at which the orbit passes its base, over the period,
        from 0 to 1; at an equilibrium the angle on the circle of starts, over a turn.
      branches: (n,) the side, 1 or -1, of each strand; 1 for all strands from a circle.
      multipliers: multipliers of the orbit, or eigenvalues of the equilibrium, to which it belongs.
      step_off: distance of the starts from the base, in the sizes of the entries.
      linear_error: estimated distance of the starts from the manifold, in these sizes.
      t0s: (n,) times of the starts, which only matter to a driven scene.
      starts: (n, k) starts.
      ts: (n,) times of the ends.
      ends: (n, k) states at those times, on a section or after a time; NaN unless the status is OK.
      status: (n,) `Status` codes.
      sample_ts: (n, s) times of the samples.
      samples: (n, s, k) states on the strands; NaN unless the status is OK.
      rtol: tolerance of the integrations.
    """

    scene: Scene
    kind: str
    orbit: Orbit | None
    base: np.ndarray
    phases: np.ndarray
    branches: np.ndarray
    multipliers: np.ndarray
    step_off: float
    linear_error: float
    t0s: np.ndarray
    starts: np.ndarray
    ts: np.ndarray
    ends: np.ndarray
    status: np.ndarray
    sample_ts: np.ndarray
    samples: np.ndarray
    rtol: float

    @_text.never_raising
    def __repr__(self) -> str:
        rest = self.orbit is None
        lasted = _text.extent(np.abs(self.ts - self.t0s)[self.ok]) if self.ok.any() else ""
        values = ", ".join(f"{z:.9g}" for z in self.multipliers)
        rows = [
            ("eigenvalue" if rest else "multiplier", values.replace("+0j", "")),
            ("strands", f"{len(self)}, {int(self.ok.sum())} of them reached their end"),
            ("step-off", f"{_text.brief(self.step_off)}, error {_text.brief(self.linear_error)}"),
            ("times", lasted),
            ("failures", "" if self.ok.all() else self.message),
        ]
        what = "equilibrium" if rest else "orbit"
        title = f"{self.kind.capitalize()} manifold of {what} of {_text.title_of(self.scene)}"
        return _text.table(title, rows)

    @_text.with_picture
    def _repr_html_(self):
        from orbits.drawing import manifolds

        return manifolds.manifold(self, title="")

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def ok(self) -> np.ndarray:
        """(n,) whether each strand reached its end."""
        return self.status == Status.OK

    @property
    def message(self) -> str:
        """Number of strands that failed, by status, and the remedies."""
        codes, counts = np.unique(self.status[~self.ok], return_counts=True)
        return "\n".join(
            f"{_text.number_of(int(n), 'strand')}: {explanation(Status(int(code)), self.scene)}"
            for n, code in zip(counts, codes, strict=True)
        )
