"""The exact period of a drive: of a rate that depends on time by sines and cosines of w t + c."""

import math
from fractions import Fraction

from jaxdyn._checks import fail
from jaxdyn.solvers.formulas.formulas import Formulas
from jaxdyn.solvers.formulas.graph import Node
from jaxdyn.solvers.formulas.shortest import topological_order

_REMEDY = "The rate may depend on time t by sines and cosines of w t + c with one number w."


def drive_period(formulas: Formulas, period: float) -> tuple[float, int]:
    """(w, n) such that 2 pi n / w is a period of the rate, exactly, and the float given, about.

    Raises:
      ValueError: time occurs otherwise than in sines and cosines of w t + c with a known float w,
        or `period` is no multiple of the common period.
    """
    frequencies = {abs(w) for w in _frequencies(formulas)}
    if not frequencies:
        raise fail("scene", "a drive by sines and cosines", "another", _REMEDY)
    slowest = min(frequencies)
    turns = round(period * slowest / (2 * math.pi))
    for w in frequencies:
        cycles = turns * Fraction(w) / Fraction(slowest)
        if turns < 1 or cycles.denominator != 1:
            raise fail("period", f"a multiple of that of cos({w} t)", period, _REMEDY)
    if abs(2 * math.pi * turns / slowest - period) > 1e-8 * period:
        raise fail("period", f"a multiple of {2 * math.pi / slowest}", period, _REMEDY)
    return slowest, turns


def _frequencies(formulas: Formulas) -> list[float]:
    time, found = formulas.time, []
    inside: dict[Node, float] = {time: 1.0}
    for node in topological_order(formulas.graph, formulas.rates):
        slopes = [inside.get(a) for a in node.args if isinstance(a, Node)]
        if all(slope is None for slope in slopes):
            continue
        slope = _slope(node, inside)
        if node.op in ("sin", "cos"):
            found.append(inside[node.args[0]])
        elif slope is None:
            raise fail("scene", "a drive by sines and cosines of w t + c", node.op, _REMEDY)
        else:
            inside[node] = slope
    return found


def _slope(node: Node, inside: dict[Node, float]) -> float | None:
    """The known w of a node w t + c."""
    if node.op == "scale" and isinstance(node.args[0], float):
        found = Fraction(node.args[0]) * Fraction(inside[node.args[1]])
        return float(found) if Fraction(float(found)) == found else None
    if node.op == "sum":
        pairs = list(zip(node.args[::2], node.args[1::2], strict=True))
        ours = [(c, m) for c, m in pairs if m in inside]
        steady = all(m is None or m in inside for _, m in pairs)
        if steady and len(ours) == 1 and ours[0][0] == 1.0:
            return inside[ours[0][1]]
    return None
