"""What is written and read: paths, scenes as JSON, motions as tables.

`input_files` reads, `output_files` and `image_files` check paths before the work, `records` turns
scenes into JSON and back, `tables` writes motions.

May import: `accuracy`.

One more format is one file, and its name below. The files are imported when they are first used,
since command lines check paths before they load JAX.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__, ["image_files", "input_files", "output_files", "records", "tables"]
)
