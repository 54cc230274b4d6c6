"""The command `jaxdyn info`: facts about the machine for bug reports."""

from rich.markup import escape
from rich.table import Table

import jaxdyn
from jaxdyn.cli.screen import screen
from jaxdyn.cli.shared import JsonOption


def info_command(as_object: JsonOption = False) -> None:
    """Print the versions, devices, settings and the cache, for bug reports."""
    with screen("asking JAX for its devices", as_object) as out:
        found = jaxdyn.info()
        if as_object:
            out.result(found)
        else:
            out.print(_table(found))


def _table(found: dict) -> Table:
    table = Table("what")
    table.add_column("found", overflow="fold")
    for name, version in found["packages"].items():
        table.add_row(name, version or "not installed")
    table.add_row("Python", found["python"])
    table.add_row("system", escape(found["system"]))
    table.add_row("devices", escape("\n".join(found["devices"])))
    table.add_row("floats", "64 bits" if found["float64"] else "32 bits")
    table.add_row("XLA_FLAGS", escape(found["XLA_FLAGS"]))
    for name, value in found["variables"].items():
        table.add_row(name, escape(value))
    size = f"{found['cached']} programs, {found['cached_bytes'] / 1e6:.1f} MB"
    table.add_row("cache", escape(f"{found['cache']}: {size}") if found["cache"] else "none")
    return table
