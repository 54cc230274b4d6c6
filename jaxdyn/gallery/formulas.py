"""What each ready-made scene solves, as formulas for the reference."""

from typing import Any

from jaxdyn._progress import each
from jaxdyn.scenes import catalogue
from jaxdyn.symbolic.equations import equations


def formulas_record() -> dict[str, Any]:
    """The equations of motion of each ready-made scene as MathML, by its public name."""
    found = {}
    for name, entry in each(catalogue.entries().items(), "deriving equations"):
        found[f"jaxdyn.scenes.{name}"] = equations(entry.make()).mathml("motion")
    return {"formulas": found}
