"""Paths of pictures and animations, checked before the work; nothing here loads Matplotlib."""

from pathlib import Path

from jaxdyn.files.output_files import writable

_PICTURES = (".png", ".pdf", ".svg")
_ANIMATIONS = (".gif", ".mp4")


def picture_path(path, name: str = "path") -> Path | None:
    """The path of a picture, checked to be writable; None if there is none.

    Args:
      path: path of the file, or None.
      name: name of the argument or option, for the message.
    """
    return None if path is None else writable(path, name, _PICTURES)


def animation_path(path, name: str = "path") -> Path:
    """The path of an animation, checked to be writable; see `picture_path`."""
    return writable(path, name, _ANIMATIONS)
