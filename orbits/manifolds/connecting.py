"""Connections of equilibria and of orbits: the call."""

from jaxdyn import Scene, _checks
from jaxdyn._checks import check_first
from jaxdyn.integrate.events import Event
from orbits.manifolds.between_equilibria import Make, connect_equilibria
from orbits.manifolds.between_orbits import OrbitOptions, connect_orbits
from orbits.manifolds.connection import Connection
from orbits.orbit import Orbit

#: Default tolerance of the integrations, and default error of the linear ends, in the sizes of the
#: entries.
RTOL, ERROR = 1e-13, 1e-8


@check_first
def connect(
    a: Scene | Orbit,
    b,
    *,
    make: Make | None = None,
    parameter: float | None = None,
    branch: str | None = None,
    until: Event | None = None,
    crossings: int | tuple[int, int] = 1,
    strands: int = 100,
    which: int = 0,
    time: float | None = None,
    error: float = ERROR,
    segments: int = 24,
    rtol: float = RTOL,
) -> Connection:
    """The connection from one equilibrium or orbit to another, or back to the same one.

    A connection of equilibria leaves `a` along its one unstable direction, and arrives at `b` on
    its stable subspace. In general this happens at isolated values of a parameter of the scene,
    which is found together with the motion. Without `make` the connection exists at the scene's own
    numbers, as a separatrix of a conservative scene does. It is found by Newton's method with exact
    derivatives, on segments; the linear ends are shortened until the error that they cause is below
    `error`.

    For a connection of orbits, strands of the unstable manifold of `a` and of the stable manifold
    of `b` are cut at the section `until`. Where their curves cross there, Newton's method begins.
    Connections of orbits in three dimensions, or in four with an energy, exist for whole ranges of
    parameters.

    Args:
      a: a scene whose start is the equilibrium, or with `make` is near it; or an orbit.
      b: (k,) the other equilibrium, or a state near it; or another orbit.
      make: the scene for each value of a parameter, e.g. ``lambda rho: lorenz(rho=rho)``. A program
        is compiled for each function, so define it once.
      parameter: a value near that of the connection.
      branch: "+" or "-", the side of `a`, by default "+"; see `orbits.manifold`. For orbits two
        signs, for the sides of both, or "both" (the default) for all sides.
      until: the section, for orbits only; directions of crossings are those along strands,
        backwards for those of `b`.
      crossings: number of the crossing at which strands end, or one for `a` and one for `b`.
      strands: number of strands on each side of each orbit.
      which: number of the connection of orbits, 0 for the one whose strands come nearest.
      time: time within which the first approach to `b` is sought, or length of a strand of an orbit
        [time of the scene].
      error: wanted estimated error of the linear ends, in the sizes of the entries.
      segments: number of segments; each has 16 of the resulting states.
      rtol: relative tolerance of a step.
    Returns:
      The motion, the parameter with its error, and an outcome.
    Raises:
      ValueError: `a` or `b` is not an equilibrium, `a` does not have exactly one unstable
        eigenvalue, `b` has no stable one, `make` and `parameter` are not given together, or a
        number is out of range; the orbits have different energies, or connections of them are not
        isolated.
      SearchError: the wanted error is not reached beside an orbit.
    Limits: host only; autonomous scenes without constraints. The connection found is the one
      nearest to the closest approach of strands; others may exist.
    Reference: Beyn (1990), IMA J. Numer. Anal. 10, 379; Doedel & Friedman (1989), J. Comput. Appl.
      Math. 26, 155; for orbits, Koon, Lo, Marsden & Ross (2000), Chaos 10, 427.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> upright = scenes.pendulum().starting([-3.141592653589793, 0.0])
      >>> orbits.connect(upright, [3.141592653589793, 0.0]).ok
      True
    """
    _checks.check_on_host("a", (a, b, parameter), "Connections are computed on the host.")
    segments = _checks.whole("segments", segments, 2)
    if isinstance(crossings, tuple) and len(crossings) != 2:
        raise _checks.fail("crossings", "one number, or one for `a` and one for `b`", crossings)
    error = float(_checks.positive("error", error, "It is a distance of states."))
    if isinstance(a, Orbit) or isinstance(b, Orbit):
        if not (isinstance(a, Orbit) and isinstance(b, Orbit)):
            remedy = "An equilibrium and an orbit are not connected here."
            raise _checks.fail("b", "two orbits, or two equilibria", "one of each", remedy)
        if make is not None or parameter is not None:
            remedy = "They are connected at each value of it."
            raise _checks.fail("make", "none for orbits", "one", remedy)
        options = OrbitOptions(
            until=until,
            crossings=crossings if isinstance(crossings, tuple) else (crossings, crossings),
            branch="both" if branch is None else branch,
            strands=strands,
            which=_checks.whole("which", which, 0),
            time=time,
            error=error,
            segments=segments,
            rtol=rtol,
        )
        return connect_orbits(a, b, options)
    if until is not None:
        raise _checks.fail("until", "none for equilibria", "a section", "Leave it out.")
    branch = "+" if branch is None else branch
    return connect_equilibria(a, b, make, parameter, branch, time, error, segments, rtol)
