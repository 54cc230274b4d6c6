"""Tables of the claims about orbits, with a column for each, and of families, with a row for each.

Claims and names may come from a file, so nothing in them is interpreted as markup.
"""

import math
import sys

from rich.markup import escape
from rich.table import Table

import orbits
from jaxdyn._text import brief, number_of, second, with_unit
from jaxdyn.cli.screen import Screen


def print_reports(
    claims: dict[str, "orbits.analysis.Report"],
    out: Screen,
    orbit: "orbits.Orbit | orbits.HybridOrbit",
) -> None:
    """Print reports side by side, each under its name, without empty rows.

    Their units are those of the scene of an orbit.
    """
    scene = orbits.families.family.first_scene(orbit)
    units = {
        "period T": second(scene.labels()),
        "energy E": scene.in_units("J"),
        "angular momentum": scene.in_units("kg m^2/s"),
    }
    table = Table("")
    for name in claims:
        table.add_column(escape(name), overflow="fold")
    for label, text in _ROWS:
        cells = [text(claim) for claim in claims.values()]
        if any(cell not in ("", _NONE) for cell in cells):
            table.add_row(escape(with_unit(label, units.get(label, ""))), *map(escape, cells))
    out.print(table)


def print_family(family: "orbits.files.family_files.Listing", out: Screen) -> None:
    """Print the members and the special points of a family, and why it ends."""
    # Without a parameter there is no first column.
    names = () if family.parameter is None else (family.parameter,)
    units = orbits.families.family.units_of(
        orbits.families.family.first_scene(family.members[0].orbit)
    )
    names += tuple(with_unit(name, unit) for name, unit in units.items())
    table = Table(*map(escape, names), "linear stability", "special")
    for entry in (*family.members, *family.special):
        table.add_row(*_row(entry)[-len(table.columns) :])
    out.print(table)
    out.print(f"{number_of(len(family.members), 'orbit')}; the end: {escape(family.end)}")


def _row(entry: "orbits.files.family_files.Entry") -> tuple[str, ...]:
    numbers = brief(entry.parameter, digits=10), brief(entry.orbit.period, digits=12)
    energy = "" if math.isnan(entry.energy) else brief(entry.energy, digits=12)
    return *numbers, energy, entry.verdict, entry.kind or ""


_NONE = "-"
_UNIT = sys.float_info.epsilon
_DIGITS = 14  # digits of numbers whose error is the closing error


def _multipliers(claim: "orbits.analysis.Report") -> str:
    shown = claim.multipliers[: len(claim.multiplier_bars)]
    lines = [brief(complex(re, im) if im else re, digits=8) for re, im in shown]
    turned = len(claim.multipliers) - len(shown) - claim.unit_multipliers
    lines += [f"{turned} of the centre of mass, which turns"] * (turned > 0)
    ones = f"{claim.unit_multipliers} times 1"
    return "\n".join([*lines, f"and {ones}" if lines else ones])


def _number(x: float | None, digits: int = _DIGITS) -> str:
    return _NONE if x is None else brief(x, digits=digits)


def _error(x: float | None) -> str:
    return _NONE if x is None else f"{x:.1e}"


def _body(claim: "orbits.analysis.Report") -> str:
    if claim.normal_form is None:
        return _NONE
    x, y = (_number(each, 11) for each in claim.normal_form.y0[:2])
    return f"({x}, {y})"


_ROWS = (
    ("is a choreography", lambda c: {None: _NONE, True: "yes", False: "NO"}[c.choreography]),
    ("  misses one by", lambda c: _error(c.permutation_error)),
    ("word", lambda c: _NONE if c.word is None else c.word or "1"),
    ("linear stability", lambda c: c.verdict),
    ("T |E|^(3/2)", lambda c: _number(c.scale_free)),
    ("period T", lambda c: _number(c.period)),
    ("  the shortest", lambda c: _number(c.minimal_period)),
    ("energy E", lambda c: _number(c.energy)),
    ("angular momentum", lambda c: _number(c.angular_momentum, 8)),
    ("closing error", lambda c: _error(c.closure)),
    ("  rounding permits", lambda c: _error(c.growth * _UNIT)),
    ("  by a second method", lambda c: f"{_error(c.recheck.closure)} ({c.recheck.solver})"),
    ("  after several periods", lambda c: f"{_error(c.return_error)} ({c.periods_simulated})"),
    ("multipliers", _multipliers),
    ("rotation numbers", lambda c: "\n".join(_number(nu, 12) for nu in c.exponents)),
    ("normal form: period", lambda c: _number(c.normal_form and c.normal_form.period)),
    ("  first body at", _body),
)
