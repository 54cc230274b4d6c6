"""The claims about orbits as a table, a column for each orbit; families, a row for each orbit.

Claims and names may come from a file: nothing of them is taken for markup.
"""

import math
import sys

from rich.markup import escape
from rich.table import Table

import orbits
from jaxdyn._text import counted
from jaxdyn.cli.screen import Screen


def print_reports(claims: dict[str, "orbits.Report"], out: Screen) -> None:
    """Print reports side by side, each under its name, without empty rows."""
    table = Table("")
    for name in claims:
        table.add_column(escape(name), overflow="fold")
    for label, text in _ROWS:
        cells = [text(claim) for claim in claims.values()]
        if any(cell not in ("", _NONE) for cell in cells):
            table.add_row(label, *map(escape, cells))
    out.print(table)


def print_family(family: "orbits.files.family_files.Listing", out: Screen) -> None:
    """Print the members and the special points of a family, and why it ends."""
    # Without a parameter there is no first column.
    names = () if family.parameter is None else (escape(family.parameter),)
    table = Table(*names, "period", "energy", "linear stability", "special")
    for entry in (*family.members, *family.special):
        table.add_row(*_row(entry)[-len(table.columns) :])
    out.print(table)
    out.print(f"{counted(len(family.members), 'orbit')}; the end: {escape(family.end)}")


def _row(entry: "orbits.files.family_files.Entry") -> tuple[str, ...]:
    numbers = f"{entry.parameter:.10g}", f"{entry.orbit.period:.12g}"
    energy = "" if math.isnan(entry.energy) else f"{entry.energy:.12g}"
    return *numbers, energy, entry.verdict, entry.kind or ""


_NONE = "-"
_UNIT = sys.float_info.epsilon


def _choreography(claim: "orbits.Report") -> str:
    return _NONE if claim.choreography is None else "yes" if claim.choreography else "NO"


def _multipliers(claim: "orbits.Report") -> str:
    shown = [complex(*z) for z in claim.multipliers[: len(claim.multiplier_bars)]]
    lines = [f"{z.real:+.7f}{z.imag:+.7f}i" if z.imag else f"{z.real:+.7f}" for z in shown]
    turned = len(claim.multipliers) - len(shown) - claim.unit_multipliers
    lines += [f"{turned} of the centre of mass, which turns"] * (turned > 0)
    ones = f"{claim.unit_multipliers} times 1"
    return "\n".join([*lines, f"and {ones}" if lines else ones])


def _optional(x: float | None, form: str) -> str:
    return _NONE if x is None else format(x, form)


_ROWS = (
    ("is a choreography", _choreography),
    ("  misses one by", lambda c: _optional(c.permutation_error, ".1e")),
    ("word", lambda c: _NONE if c.word is None else c.word or "1"),
    ("linear stability", lambda c: c.verdict),
    ("T |E|^(3/2)", lambda c: _optional(c.scale_free, ".13f")),
    ("period T", lambda c: f"{c.period:.13f}"),
    ("  the shortest", lambda c: f"{c.minimal_period:.13f}"),
    ("energy E", lambda c: _optional(c.energy, ".13f")),
    ("angular momentum", lambda c: _optional(c.angular_momentum, ".1e")),
    ("closing error", lambda c: f"{c.closure:.1e}"),
    ("  rounding permits", lambda c: f"{c.growth * _UNIT:.1e}"),
    ("  by a second method", lambda c: f"{c.recheck.closure:.1e} ({c.recheck.solver})"),
    ("  after several periods", lambda c: f"{c.return_error:.1e} ({c.periods_simulated})"),
    ("multipliers", _multipliers),
    ("rotation numbers", lambda c: "\n".join(_optional(nu, ".12f") for nu in c.exponents)),
    ("normal form: period", lambda c: f"{c.normal_form.period:.13f}" if c.normal_form else _NONE),
    (
        "  first body at",
        lambda c: "({:.10f}, {:.10f})".format(*c.normal_form.y0[:2]) if c.normal_form else _NONE,
    ),
)
