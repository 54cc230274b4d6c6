"""The equations of each ready-made scene, as formulas for the reference."""

from typing import Any

from jaxdyn._progress import each
from jaxdyn.scenes import catalogue
from jaxdyn.symbolic.equations import equations


def formulas_record() -> dict[str, Any]:
    """The equations of motion of each ready-made scene as MathML, by its public name.

    The meaning of symbols and functions that a reader may not know is added.
    """
    found = {}
    for name, entry in each(catalogue.entries().items(), "deriving equations"):
        printed = equations(entry.make())
        shown = [part.name for part in printed.sections if part.name in ("motion", "symbols")]
        found[f"jaxdyn.scenes.{name}"] = "\n".join(map(printed.mathml, shown))
    return {"formulas": found}
