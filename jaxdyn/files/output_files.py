"""Output files, which are checked before the work and replaced atomically.

Every function that writes a file calls `writable` before its work, so that a missing folder, a
read-only one or a full disk is reported at once; `replace` writes text atomically; `append` adds
text, which is on the disk when it returns. A new file gets the usual mode, an existing one keeps
its own; a symbolic link stays, and its target is written.
"""

import errno
import os
import secrets
import stat
import tempfile
from pathlib import Path

from jaxdyn._text import fail
from jaxdyn.files.input_files import as_path

_PROBE = 4096  # bytes that must fit on the disk: one block of most file systems


def writable(path: str | Path, name: str = "path", suffixes: tuple[str, ...] = ()) -> Path:
    """The path of a file that can be written.

    Args:
      path: path of the file; an existing one is left unchanged.
      name: name of the argument or option, for the message.
      suffixes: allowed endings of its name; any if left out.
    Raises:
      ValueError: `path` has another suffix, its folder does not exist or cannot be written to, it
          is not a file, or the disk is full.
    """
    path = as_path(path, name)
    if suffixes and path.suffix.lower() not in suffixes:
        raise fail(name, f"a file name ending in {', '.join(suffixes)}", f"'{path}'")
    try:
        target = target_of(path)
        if not target.parent.is_dir():
            raise fail(
                name, "a file in a folder that exists", f"'{path}'", "Make the folder first."
            )
        if target.exists() and not target.is_file():
            raise fail(name, "a file", f"'{path}', which is none", "Give it a name of its own.")
        _try(target)
    except OSError as error:
        raise unwritable(path, error, name) from error
    return path


def table_path(path: str | Path, name: str = "path") -> Path:
    """The path of a table (.csv), checked to be writable."""
    return writable(path, name, (".csv",))


def archive_path(path: str | Path, name: str = "path") -> Path:
    """The path of an archive (.npz), checked to be writable."""
    return writable(path, name, (".npz",))


def page_path(path: str | Path, name: str = "path") -> Path:
    """The path of a page for browsers (.html), checked to be writable."""
    return writable(path, name, (".html",))


def unwritable(path: str | Path, error: OSError, name: str = "path") -> ValueError:
    """The error to raise where a file cannot be written."""
    reason = error.strerror or type(error).__name__
    wanted = "a folder" if name == "folder" else "a file"
    got = f"'{path}' ({reason})"
    return fail(name, f"{wanted} that can be written", got, "Choose another place.")


def target_of(path: Path) -> Path:
    """The path of the file to which symbolic links lead.

    Raises:
      OSError: the links have no end.
    """
    target = Path(os.path.realpath(path))
    if target.is_symlink():
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
    return target


def replace(path: Path, text: str | bytes) -> None:
    """Write a file atomically: a killed process or a full disk leaves the old one.

    Raises:
      OSError: `path` cannot be written.
    """
    target = target_of(path)
    temporary = target.with_name(f".{secrets.token_hex(8)}.part")
    try:
        old = stat.S_IMODE(target.stat().st_mode) if target.exists() else None
        # Unlike a temporary file of Python, which is private, it gets its mode from the umask.
        mode = 0o666 if old is None else old & 0o666
        with open(temporary, "xb", opener=lambda name, flags: os.open(name, flags, mode)) as file:
            if old is not None:
                os.chmod(temporary, old)
            file.write(text if isinstance(text, bytes) else text.encode())
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def append(path: Path, data: bytes) -> None:
    """Write data at the end of a file; they are on the disk when this returns.

    Raises:
      OSError: it cannot be written.
    """
    with open(path, "ab") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _try(path: Path) -> None:
    """Try what writing the file will do, without leaving a trace."""
    with tempfile.TemporaryFile(dir=path.parent) as file:
        file.write(bytes(_PROBE))
        file.flush()
    if path.exists():
        with open(path, "ab"):
            pass


# ---- Paths of pictures and animations, checked before the work; nothing here loads Matplotlib

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
