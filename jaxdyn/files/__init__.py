"""Files that are written and read: paths, scenes as JSON, motions as archives and as tables.

`input_files` reads files; `output_files` checks paths before the work. The `codec` turns values of
every kind, arrays and scenes among them, into JSON and back; the `layout` says what a file is, and
writes documents; a `journal` grows line by line, written by one program or by several in turn;
`rows` are those of a long computation, kept in one. `loading` reads a file of any kind by its
format, with readers that packages register. `motion_files` saves and loads motions as `archives` of
NumPy; `tables` writes them as CSV and JSON, `data_frames` for pandas; `astronomy` reads the formats
of astronomers. All files that are read again end with one of the `digests`, by which any changed
byte is noticed.

May import: `accuracy`, `scenes`, `vibration`.

To add a format, write one file, and its name below. The files are imported when they are first
used, since command lines check paths before they load JAX.
"""

import lazy_loader

import jaxdyn._doors

_listed, __dir__, __all__ = lazy_loader.attach(
    __name__,
    [
        "archives",
        "astronomy",
        "codec",
        "data_frames",
        "digests",
        "input_files",
        "journal",
        "layout",
        "loading",
        "motion_files",
        "output_files",
        "rows",
        "tables",
    ],
)
#: Moved in version 0.3.
__getattr__ = jaxdyn._doors.attribute_getter(
    __name__, _listed, modules={"image_files": "jaxdyn.files.output_files"}
)
