"""Units as text, such as "mm/s" or "kg m^2": their size in SI units, and what they measure.

Angles are a quantity of their own, in radians: a unit of an angular velocity is not one of a
frequency. "Hz" is therefore not known here, since it may mean turns or radians.
"""

import math
import re
from collections import Counter
from typing import NamedTuple

from jaxdyn._text import fail

_DAY = 86_400.0
#: The gravitational constant [m^3/(kg s^2), CODATA 2018].
GRAVITATIONAL_CONSTANT = 6.67430e-11
#: The gravitational constant times nominal masses [m^3/s^2]. IAU 2015 resolution B3.
_GRAVITIES = {"Msun": 1.3271244e20, "Mjup": 1.2668653e17, "Mearth": 3.986004e14}
#: Size in SI units, and the power of each base unit.
_KNOWN: dict[str, tuple[float, dict[str, int]]] = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), (1.0, {"m": 1})),
    "km": (1e3, {"m": 1}),
    "dm": (0.1, {"m": 1}),
    "cm": (1e-2, {"m": 1}),
    "mm": (1e-3, {"m": 1}),
    "um": (1e-6, {"m": 1}),
    "nm": (1e-9, {"m": 1}),
    "in": (0.0254, {"m": 1}),
    "ft": (0.3048, {"m": 1}),
    **dict.fromkeys(("AU", "au"), (149_597_870_700.0, {"m": 1})),
    **dict.fromkeys(("s", "sec", "second", "seconds"), (1.0, {"s": 1})),
    "ms": (1e-3, {"s": 1}),
    "us": (1e-6, {"s": 1}),
    "ns": (1e-9, {"s": 1}),
    **dict.fromkeys(("min", "minute", "minutes"), (60.0, {"s": 1})),
    **dict.fromkeys(("h", "hr", "hour", "hours"), (3600.0, {"s": 1})),
    **dict.fromkeys(("d", "day", "days"), (_DAY, {"s": 1})),
    **dict.fromkeys(("yr", "year", "years"), (365.25 * _DAY, {"s": 1})),
    "kg": (1.0, {"kg": 1}),
    "g": (1e-3, {"kg": 1}),
    **{name: (x / GRAVITATIONAL_CONSTANT, {"kg": 1}) for name, x in _GRAVITIES.items()},
    **dict.fromkeys(("rad", "rads", "radian", "radians"), (1.0, {"rad": 1})),
    "mrad": (1e-3, {"rad": 1}),
    **dict.fromkeys(("deg", "degree", "degrees", "\N{DEGREE SIGN}"), (math.pi / 180, {"rad": 1})),
    **dict.fromkeys(("rev", "turn", "turns"), (2 * math.pi, {"rad": 1})),
    "rpm": (2 * math.pi / 60, {"rad": 1, "s": -1}),
    "N": (1.0, {"kg": 1, "m": 1, "s": -2}),
    "J": (1.0, {"kg": 1, "m": 2, "s": -2}),
    "W": (1.0, {"kg": 1, "m": 2, "s": -3}),
    "1": (1.0, {}),
}
_FACTOR = re.compile(r"(?P<name>[^\W\d]+|\N{DEGREE SIGN}|1)(?:\^?(?P<power>[+-]?\d+))?")
_PLAIN = str.maketrans(
    {
        "\N{SUPERSCRIPT TWO}": "^2",
        "\N{SUPERSCRIPT THREE}": "^3",
        "\N{MICRO SIGN}": "u",
        "\N{GREEK SMALL LETTER MU}": "u",
    }
)


class Measure(NamedTuple):
    """What a unit measures.

    Attributes:
      size: its size in SI units.
      powers: the powers of the base units that are not 0, sorted by name.
    """

    size: float
    powers: tuple[tuple[str, int], ...]


def measure(unit: str) -> Measure | None:
    """The measure of a unit; None where a part of it is not known.

    Example:
      >>> measure("km/h").size, measure("m s^-1").powers == measure("km/h").powers
      (0.2777777777777778, True)
    """
    size, powers = 1.0, Counter()
    for i, part in enumerate(unit.translate(_PLAIN).split("/")):
        for word in re.split(r"[\s*.\N{MIDDLE DOT}]+", part.strip(" ()")):
            found = _FACTOR.fullmatch(word)
            known = None if found is None else _known(found["name"])
            if found is None or known is None:
                return None
            power = int(found["power"] or 1) * (-1 if i else 1)
            one, bases = known
            size *= one**power
            for base, exponent in bases.items():
                powers[base] += power * exponent
    return Measure(size, tuple(sorted((base, n) for base, n in powers.items() if n)))


def _known(word: str) -> tuple[float, dict[str, int]] | None:
    """A unit's size and powers; words of three letters and more, as "Sec", in any case."""
    return _KNOWN.get(word) or (_KNOWN.get(word.lower()) if len(word) > 2 else None)


#: Units that stand for products of base units.
_DERIVED = re.compile(r"\b(N|J|W)\b")


def in_base_units(unit: str, names: tuple[str, str, str]) -> str:
    """A unit made of m, kg, s and of N, J, W, for base units with other names.

    Args:
      unit: a unit such as "m/s" or "N/m".
      names: those of the units of length, mass and time; the mass may be "", where numbers are per
        mass.
    Returns:
      The unit; "" where a part of it is not known.
    Example:
      >>> in_base_units("m/s", ("km", "kg", "day")), in_base_units("J", ("AU", "Msun", "day"))
      ('km/day', 'Msun AU^2/day^2')
      >>> in_base_units("J", ("km", "", "day"))
      'km^2/day^2'
    """
    others: dict[str, str] = dict(zip(("m", "kg", "s"), names, strict=True))
    if all(name == other for name, other in others.items()):
        return unit
    if all(others.values()) and not _DERIVED.search(unit):
        return re.sub(r"\b(m|kg|s)\b", lambda found: others[found[0]], unit)
    found = measure(unit)
    if found is None:
        return ""
    powers = {others.get(base, base): n for base, n in found.powers}
    powers.pop("", None)
    up = [_power(name, n) for name, n in powers.items() if n > 0]
    down = [_power(name, -n) for name, n in powers.items() if n < 0]
    over = f"({' '.join(down)})" if len(down) > 1 else "".join(down)
    return "/".join(filter(None, [" ".join(up) or "1", over]))


def _power(name: str, n: int) -> str:
    return name if n == 1 else f"{name}^{n}"


def conversion(name: str, given: str, wanted: str) -> float:
    """The size of a unit in another one of the same quantity.

    Args:
      name: what messages call what is converted.
      given: the unit that it has.
      wanted: the other one.
    Raises:
      ValueError: one of them is not known, or they measure different quantities.
    Example:
      >>> conversion("x", "mm", "km")
      1e-06
    """
    if given == wanted:
        return 1.0
    one, other = measure(given), measure(wanted)
    if one is None or other is None or one.powers != other.powers:
        remedy = "Convert the numbers, and leave the unit out of the name of the column."
        raise fail(name, f"values in {wanted}, or a unit that is converted to it", given, remedy)
    return one.size / other.size
