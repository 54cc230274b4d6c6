"""Impacts in print: where they happen in a motion through phases, and the state after them."""

import numpy as np

from jaxdyn.integrate.phase import END
from jaxdyn.scene import Scene
from jaxdyn.scenes.corners import has_corners, phases_of
from jaxdyn.symbolic.algebra import Expression, Symbol, as_expression
from jaxdyn.symbolic.reading import read
from jaxdyn.symbolic.symbols import Symbols


def impacts(scene: Scene, of: Symbols) -> list[tuple[Expression, dict[Symbol, Expression]]]:
    """The impacts that end the phase of a ready-made scene; none if its motion is smooth.

    Args:
      scene: any.
      of: its symbols.
    Returns:
      For each impact a sum that is 0 there, and the entries of the state that it changes, as
      symbols with a +, with their values after it.
    """
    if not has_corners(scene):
        return []
    found = []
    for name, phase in phases_of(scene).items():
        if phase.scene.system is not scene.system:  # other equations hold there
            continue
        for number, exit_ in enumerate(phase.exits):
            if exit_.to == END:
                continue

            def law(field, t, y, name=name, number=number):
                moved = Scene(*field, y0=scene.y0, t1=scene.t1)
                exit_ = phases_of(moved)[name].exits[number]
                return exit_.event.value(t, y), getattr(exit_.change, "law", exit_.change)(t, y)

            where, after = read(scene, of, law)
            if changed := _changed(of, after):
                found.append((where[()], changed))
    return found


def _changed(of: Symbols, after: np.ndarray) -> dict[Symbol, Expression]:
    """The entries that an impact changes."""
    pairs = zip(of.state, after.tolist(), strict=True)
    return {_after(s): x for s, x in pairs if (x - as_expression(s)).expand()}


def _after(s: Symbol) -> Symbol:
    """The symbol of an entry just after an impact."""
    index = f"{s.index}+"
    return Symbol(f"{s.name}+", s.kind, rank=s.rank, stem=s.stem, index=index, dots=s.dots)
