"""Index notation under the summation convention: validity and value of an expression.

An expression is written as on paper, one letter for each index, for example ``c_i = A_ij b_j``,
``A_ii b_j + f_i g_i h_j = B_ii e_j`` or, without a left side, ``delta_ij delta_jk delta_ki``.
An index that occurs twice in a product is summed (a dummy), one that occurs once is free. The
rules: no index three times in a product, and the same free indices in every term on both sides.
``delta`` is Kronecker's symbol and ``epsilon`` that of Levi-Civita.

This is problem 41 of the course, whose text has two misprints: c_3 = A_3j b_3 should end in b_j,
and in a x b = a_i e_i x b_i e_j the second vector is b_j e_j.

Powers, divisions and "no sum" are not supported; for sums inside a program use ``jnp.einsum``.
"""

import re
from collections import Counter
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._checks import as_float, check_first, fail, float64

_FACTOR = re.compile(r"\s*\*?\s*(?:(\d+\.?\d*)|([A-Za-z]+)(?:_([a-z]+))?)\s*")


def kronecker(d: int = 3) -> np.ndarray:
    """Kronecker's delta (d, d): 1 where both indices agree, else 0."""
    return np.eye(d)


def levi_civita(d: int = 3) -> np.ndarray:
    """The alternating symbol with d indices: 1 for even permutations, -1 for odd ones, else 0."""
    index = np.indices((d,) * d)
    pairs = [np.sign(index[b] - index[a]) for a in range(d) for b in range(a + 1, d)]
    return np.prod(pairs, axis=0).astype(float)


class IndexCheck(NamedTuple):
    """Whether an expression is valid (`sensible`), its free indices, and why it is not."""

    sensible: bool
    free: str
    reason: str


class _Term(NamedTuple):
    text: str
    coefficient: float
    factors: list[tuple[str, str]]  # (name, indices)


@check_first
def check_indices(expression: str) -> IndexCheck:
    """Whether an index expression is valid under the summation convention, and why not.

    Example:
      >>> check_indices("c_i = A_ij b_j").sensible
      True
      >>> check_indices("c_i = A_ij B_jk").reason
      "free indices: expected i in every term, got ik in 'A_ij B_jk'."
    """
    try:
        return IndexCheck(True, _parse(expression)[1], "")
    except ValueError as error:
        return IndexCheck(False, "", str(error))


@check_first
def evaluate_indices(expression: str, **arrays) -> Array:
    """Value of the right side of a valid index expression.

    Args:
      expression: see above; the array on its left side is the result and is not given.
      arrays: every other array by its name, with length d along each axis (d = 3, or 2 in the
        plane).
    Returns:
      An array with one axis for each free index, in the order in which the first term (the left
      side, where there is one) names them.
    Raises:
      ValueError: `expression` is not valid, or an array is missing or has another number of axes
          than indices.
    Example:
      >>> float(evaluate_indices("c = delta_ii"))
      3.0
    """
    float64()
    terms, free = _parse(expression)
    given = {name: as_float(a) for name, a in arrays.items()}
    d = next((n for a in given.values() for n in a.shape), 3)
    given = {"delta": jnp.asarray(kronecker(d)), "epsilon": jnp.asarray(levi_civita(d))} | given
    total = _value(terms[0], free, given, d)
    for term in terms[1:]:
        total = total + _value(term, free, given, d)
    return total


def _value(term: _Term, free: str, given: dict[str, Array], d: int) -> Array:
    for name, index in term.factors:
        if name not in given:
            raise fail(name, f"an array for each name in {term.text!r}", "none", "Pass it by name.")
        if given[name].shape != (d,) * len(index):
            raise fail(name, f"shape {(d,) * len(index)}", f"shape {given[name].shape}")
    if not term.factors:
        return jnp.asarray(term.coefficient)
    inputs = ",".join(index for _, index in term.factors)
    return term.coefficient * jnp.einsum(f"{inputs}->{free}", *(given[n] for n, _ in term.factors))


def _parse(expression: str) -> tuple[list[_Term], str]:
    # The terms of the right side and the free indices; ValueError if the expression is invalid.
    sides = expression.split("=")
    if len(sides) > 2:
        raise fail("expression", "at most one '='", repr(expression))
    sides = [_terms(side) for side in sides]
    free = _free(sides[0][0])
    for term in [term for side in sides for term in side]:
        if set(_free(term)) != set(free):
            got = f"{_free(term) or 'none'} in {term.text!r}"
            raise fail("free indices", f"{free or 'none'} in every term", got)
    return sides[-1], free


def _terms(side: str) -> list[_Term]:
    pieces = side.replace("-", "+-").split("+")
    if len(pieces) > 1 and not pieces[0].strip():
        pieces = pieces[1:]  # a sign before the first term
    return [_term(piece.strip()) for piece in pieces]


def _term(text: str) -> _Term:
    coefficient, factors = (-1.0 if text.startswith("-") else 1.0), []
    rest = text.removeprefix("-").strip()
    if not rest:
        raise fail("term", "a product such as A_ij b_j", "nothing")
    while rest:
        match = _FACTOR.match(rest)
        if match is None:
            raise fail("term", "products of names with indices, A_ij", repr(rest))
        number, name, index = match.groups()
        if number is None:
            factors.append((name, index or ""))
        else:
            coefficient *= float(number)
        rest = rest[match.end() :]
    return _Term(text, coefficient, factors)


def _free(term: _Term) -> str:
    counts = Counter("".join(index for _, index in term.factors))
    for letter, count in counts.items():
        if count > 2:
            got = f"{count} times in {term.text!r}"
            raise fail(f"index {letter}", "once or twice in a product", got)
    return "".join(letter for letter, count in counts.items() if count == 1)
