"""Numbers with their nouns, for what people read."""


def counted(n: int, noun: str, plural: str = "") -> str:
    """A number with its noun, e.g. "1 loop" or "2 families".

    Args:
      n: how many.
      noun: for one of them.
      plural: for several; the noun with an s if left out.
    Example:
      >>> counted(1, "loop"), counted(0, "loop"), counted(2, "family", "families")
      ('1 loop', '0 loops', '2 families')
    """
    return f"{n} {noun if n == 1 else plural or noun + 's'}"
