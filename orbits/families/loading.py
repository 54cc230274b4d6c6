"""Bifurcation diagrams, and families in a parameter, read from a file."""

from pathlib import Path

from jaxdyn._checks import fail
from jaxdyn._records import with_captures
from jaxdyn.continuation.checkpoint import EQUILIBRIA, OTHER, walks_in
from jaxdyn.continuation.loading import equilibria
from jaxdyn.files.codec import decode
from orbits.families.checkpoint import ORBITS, family
from orbits.families.diagram import DOUBLINGS, FAILURE, Diagram, Failure, place_of
from orbits.shooting.segment import Make


def load(path: str | Path, make: Make) -> Diagram:
    """The families of equilibria and of orbits in a file, which may still be being written.

    Args:
      path: path of the file that `orbits.diagram`, `orbits.continue_family` or
        `jaxdyn.continue_equilibria` wrote with ``path=``.
      make: the scene for each value of the parameter, as it was given to them: files hold only
        numbers.
    Returns:
      All families as a diagram; for an interrupted run, what it had found.
    Raises:
      ValueError: the file is of another kind, was edited or damaged, has a family without a
        parameter or with conditions, or does not hold equilibria and orbits of these scenes.
    """
    make = with_captures("make", make)
    walks, notes = walks_in(path, (EQUILIBRIA, ORBITS))
    rests = tuple(equilibria(walk, make) for walk in walks if walk.begin.what == EQUILIBRIA)
    around = [walk for walk in walks if walk.begin.what == ORBITS]
    depths = [decode(walk.begin.note.get(DOUBLINGS, 0), int, DOUBLINGS, OTHER) for walk in around]
    families = tuple(family(walk, make) for walk in around)
    special = [point for each in (*rests, *families) for point in each.special]
    failures = []
    for note in (note for note in notes if FAILURE in note):
        at = [x for x in special if place_of(x).items() <= note.items()]
        if not at:
            raise fail("file", "failures at special points", "others", OTHER)
        failures.append(Failure(at[0], decode(note[FAILURE], str, FAILURE, OTHER)))
    return Diagram(rests, families, tuple(depths), tuple(failures))
