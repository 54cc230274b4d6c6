"""Which entries of the state are coordinates of a section."""

from collections.abc import Iterable, Sequence

import numpy as np

from jaxdyn import Scene
from jaxdyn._checks import check_first, choice, fail
from jaxdyn.integrate.events import Event, Reaches
from orbits.closing.sizes import sizes

#: By how much entries are perturbed, relative to their sizes: at rest all velocities are equal.
_PROBE = 1e-3


@check_first
def names_of(scene: Scene) -> list[str]:
    """The names of the entries of the state."""
    return [name for name, _ in scene.labels()]


@check_first
def entry(scene: Scene, argument: str, name: str) -> int:
    """The entry of the state with a name.

    Raises:
      ValueError: there is none; the nearest name is suggested.
    """
    return names_of(scene).index(choice(argument, name, names_of(scene)))


def fixed_entry(event: Event) -> int | None:
    """The entry that the event fixes; None for events of other kinds."""
    return event.entry if isinstance(event, Reaches) else None


@check_first
def has_velocities(scene: Scene) -> bool:
    """Whether the state is [q, v] with dq/dt = v, tested at a state where all v differ."""
    k = len(scene.y0)
    if k % 2:
        return False
    y = np.asarray(scene.y0) + _PROBE * sizes(scene) * np.arange(1, k + 1)
    return bool(np.array_equal(scene.vector_field(0.0, y)[: k // 2], y[k // 2 :]))


@check_first
def pair(scene: Scene, event: Event, coordinates: Sequence[str] | None = None) -> tuple[int, int]:
    """The two entries of a section that are drawn: those named, or a position and its velocity.

    The default is the first position that the event leaves free, with its velocity where the state
    is [q, v] and with the next free entry elsewhere; for a state of two entries, both.

    Raises:
      ValueError: the names are not two different entries, or there are no two to choose.
    """
    if coordinates is not None:
        given = [entry(scene, "coordinates", name) for name in coordinates]
        if len(given) != 2 or given[0] == given[1]:
            raise fail("coordinates", "two different entries", ", ".join(coordinates))
        return given[0], given[1]
    k, taken = len(scene.y0), fixed_entry(event)
    half = k // 2
    if has_velocities(scene):
        for q in range(half):
            if taken not in (q, q + half):
                return q, q + half
    free = [i for i in range(k) if i != taken or k == 2]
    if len(free) < 2:
        names = ", ".join(names_of(scene))
        raise fail("event", "one that leaves two entries free", names, "Name the coordinates.")
    return free[0], free[1]


@check_first
def unknown_of(scene: Scene, event: Event, unknown: str | None) -> int:
    """The entry that the energy determines: the one named, or the velocity of the fixed position.

    Raises:
      ValueError: the name is not that of an entry, or there is no such velocity.
    """
    if unknown is not None:
        return entry(scene, "unknown", unknown)
    taken, half = fixed_entry(event), len(scene.y0) // 2
    if taken is None or taken >= half or not has_velocities(scene):
        names = ", ".join(names_of(scene))
        raise fail("unknown", f"the name of one of {names}", "none", "The energy determines it.")
    return taken + half


def list_names(names: Iterable[str]) -> str:
    """Names in a message."""
    return ", ".join(names) or "none"
