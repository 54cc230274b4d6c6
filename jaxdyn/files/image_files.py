"""Files of pictures and animations, refused before the work; to look at a name draws nothing."""

from pathlib import Path

from jaxdyn.files.output_files import writable

_PICTURES = (".png", ".pdf", ".svg")
_ANIMATIONS = (".gif", ".mp4")


def picture_path(path, name: str = "path") -> Path | None:
    """The file of a picture, refused if it could not be written; None where none is wanted.

    Args:
      path: of the file, or None.
      name: of the argument or option, for the message.
    """
    return None if path is None else writable(path, name, _PICTURES)


def animation_path(path, name: str = "path") -> Path:
    """The file of an animation, refused if it could not be written; see `picture_path`."""
    return writable(path, name, _ANIMATIONS)
