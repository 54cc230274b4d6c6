"""Results for JSON, which has no NaN and no infinities: null stands for both."""

import math
from typing import Any


def with_null(value: Any) -> Any:
    """A value of lists, dictionaries and arrays with None for each number that is not finite.

    Arrays become nested lists.

    Example:
      >>> with_null({"error": float("nan"), "steps": (3, 4)})
      {'error': None, 'steps': [3, 4]}
    """
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {key: with_null(x) for key, x in value.items()}
    if isinstance(value, list | tuple):
        return [with_null(x) for x in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
