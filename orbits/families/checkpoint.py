"""Families of orbits in the file of a continuation: members written as JSON and read again."""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import fail
from jaxdyn.continuation.branch import read
from jaxdyn.continuation.checkpoint import OTHER, Codec, SavedBranch
from jaxdyn.files.codec import decode, decode_fields, decode_part, encode
from orbits.closing.closings import Closing, Symmetry
from orbits.closing.given import beside
from orbits.families.family import Family, Member
from orbits.families.surface import OrbitSurface, Point, Surface
from orbits.hybrid.equations import ChainEquations
from orbits.shooting.equations import Equations, InUnits
from orbits.shooting.strategy import GOAL

#: What the file of a continuation calls a family: one of orbits, or one of chains of legs.
ORBITS, CHAINS = "orbits", "chains"
_UNITS = ("sizes", "units")  # fields of a point that files of earlier versions do not have
_NOT_NUMBERS = ("equations", "jacobian", "growth")  # fields of a point that are not written
#: Entry of a point whose orbit was cut into other segments than the first orbit.
_CUTS = "cuts"
_HOLDS = 1e-6  # largest relative closing error of an orbit that belongs to these scenes


class _Segmentation(NamedTuple):
    """Where an orbit is cut (`Equations`)."""

    shares: tuple[float, ...]
    s_spans: tuple[float, ...] | None


def codec(surface: Surface) -> Codec:
    """The codec of members; the orbit of each follows from its point on a surface of solutions."""

    def pack(member: Member) -> dict[str, Any]:
        point = encode(member.point, _NOT_NUMBERS)
        cuts = member.point.equations
        if cuts is not surface.equations:
            point |= encode({_CUTS: _Segmentation(cuts.shares, cuts.s_spans)})
        return encode(member, ("orbit", "point")) | {"point": point}

    def unpack(record: Any) -> Member:
        fields = decode_fields(record, Member, "file", OTHER, ("orbit",), raw=("point",))
        numbers, cuts = fields.pop("point"), surface.equations
        if isinstance(numbers, dict) and _CUTS in numbers:
            given = decode(numbers[_CUTS], _Segmentation, "file", OTHER)
            cuts = dataclasses.replace(cuts, shares=given.shares, s_spans=given.s_spans)
            numbers = {name: x for name, x in numbers.items() if name != _CUTS}
        old = _without_units(numbers)
        without = (*_NOT_NUMBERS, *(_UNITS if old else ()))
        known = decode_fields(numbers, Point, "file", OTHER, without)
        if old:
            point = surface.point(known["x"], known["residual"], known["iterations"])
            fields |= _in_units(point, fields)
        else:
            # The Jacobian is needed only for the next step, which was taken, and is not stored.
            none = np.full((1, known["x"].size), np.nan)
            point = Point(**known, equations=cuts, jacobian=none)
        return Member(**fields, point=point, orbit=surface.at(point).orbit(point))

    return Codec(pack, unpack)


def _without_units(point: Any) -> bool:
    """Whether a point is from a file in which all lengths are in the units of the scene."""
    return isinstance(point, dict) and not any(name in point for name in _UNITS)


def _in_units(point: Point, fields: dict[str, Any]) -> dict[str, np.ndarray]:
    """The directions of a member from such a file, of unit length in the units of its point."""
    tangent, alike = fields["tangent"], fields["alike"]
    if tangent.shape != point.x.shape or alike.shape[:1] != point.x.shape:
        raise fail("file", "directions of the unknowns", f"{tangent.shape}, {alike.shape}", OTHER)
    length = float(np.linalg.norm(tangent / point.units))
    basis = np.linalg.qr(alike / point.units[:, None])[0]
    return {"tangent": tangent / length, "alike": point.units[:, None] * basis}


def what(surface: Surface) -> str:
    """What the file of a continuation calls the families on a surface."""
    return CHAINS if isinstance(surface.equations, ChainEquations) else ORBITS


def about(surface: Surface) -> dict[str, Any]:
    """The data, other than the scenes, that distinguish the equations of a family from others."""
    equations = surface.equations
    if isinstance(equations, ChainEquations):
        closes = getattr(equations.closes, "__qualname__", type(equations.closes).__name__)
        path = [[name, number] for name, number in equations.path]
        legs = len(equations.legs)
        return {"legs": legs, "path": path, "closes": closes, "rtol": float(surface.rtol)}
    return {
        "closing": encode(equations.closing),
        "conditions": [type(condition).__name__ for condition in equations.conditions],
        "along": equations.make is not None,
        "shares": list(equations.shares),
        "s_spans": None if equations.s_spans is None else list(equations.s_spans),
        "collocated": equations.collocated,
        "stiff": equations.stiff,
        "rtol": float(surface.rtol),
    }


class _About(NamedTuple):
    """The entries of `about`."""

    closing: dict
    conditions: list[str]
    along: bool
    shares: tuple[float, ...]
    s_spans: tuple[float, ...] | None
    collocated: bool
    stiff: bool
    rtol: float


def family_of(walk: SavedBranch, make: Callable[[Array], Scene]) -> Family:
    """The family that a file holds as a `SavedBranch`.

    Raises:
      ValueError: its orbits do not close in these scenes.
    """
    known = decode(walk.begin.about, _About, "file", OTHER)
    closing = decode_part(known.closing, Closing, "closing", (Symmetry,), OTHER)
    place = walk.begin.place
    x = place[: place.size // 2]
    if known.conditions or not known.along or x.size < 3:
        raise fail("file", "a family in a parameter, without conditions", "another", OTHER)
    scene = make(jnp.asarray(x[-2]))
    k = len(scene.labels())
    if len(closing.free(k)) < k or x.size != len(known.shares) * k + 2 + closing.turns:
        raise fail(
            "make", "the scenes of the file", f"others, with {k} entries of the state", OTHER
        )
    scene = scene.starting(x[:k], float(x[-1]))
    equations = Equations(
        scene=scene,
        closing=closing,
        make=make,
        shares=known.shares,
        s_spans=known.s_spans,
        beside=beside(scene),
        collocated=known.collocated,
        stiff=known.stiff,
    )
    surface = OrbitSurface(equations, known.rtol, GOAL)
    found = read(walk, codec(surface))
    for member in (found.members[0], found.members[-1]):
        x, known = member.point.x, surface.at(member.point).unknown_sizes(member.point)
        residual, _ = InUnits(member.point.equations, x, surface.rtol, known=known)(x)
        if not np.abs(residual).max() <= _HOLDS:
            raise fail("make", "the scenes of the file", "others, whose orbits do not close", OTHER)
    return Family(found.members, found.special, found.end, equations)
