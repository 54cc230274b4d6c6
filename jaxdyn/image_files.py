"""Files of pictures and animations, refused before the work; to look at a name draws nothing."""

from pathlib import Path

from jaxdyn import _checks

_PICTURES = (".png", ".pdf", ".svg")
_ANIMATIONS = (".gif", ".mp4")


def picture_path(path) -> Path | None:
    """The file of a picture, refused if it could not be written; None where none is wanted."""
    return None if path is None else _checked(path, _PICTURES)


def animation_path(path) -> Path:
    """The file of an animation, refused if it could not be written."""
    return _checked(path, _ANIMATIONS)


def _checked(path, suffixes: tuple[str, ...]) -> Path:
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise _checks.fail("path", f"a file name ending in {', '.join(suffixes)}", f"'{path}'")
    if not path.parent.is_dir():
        raise _checks.fail(
            "path", "a file in a folder that exists", f"'{path}'", "Make the folder first."
        )
    return path
