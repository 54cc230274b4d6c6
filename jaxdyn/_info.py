"""What an error report should say about the machine: versions, devices, settings, the cache."""

import importlib.metadata
import os
import platform
from pathlib import Path
from typing import Any

import jax

#: The packages that results depend on, then the optional ones.
_PACKAGES = (
    *("jaxdyn", "jax", "jaxlib", "diffrax", "equinox", "optax", "numpy", "scipy", "matplotlib"),
    *("dask", "python-flint", "pandas", "xarray"),
)


def info() -> dict[str, Any]:
    """Versions, devices, settings and the cache: what an error report should say.

    Returns:
      A record of texts and numbers, which `json.dumps` takes: ``packages`` (None for one that is
      not installed), ``python``, ``system``, ``devices``, ``float64``, ``XLA_FLAGS``, ``variables``
      (those of the environment whose name begins with JAX), ``cache`` (its folder, None without
      one), ``cached`` (the number of compiled programs in it) and ``cached_bytes``.
    Example:
      >>> import jaxdyn
      >>> sorted(jaxdyn.info())[:4]
      ['XLA_FLAGS', 'cache', 'cached', 'cached_bytes']
    """
    cache = jax.config.jax_compilation_cache_dir
    sizes = [file.stat().st_size for file in Path(cache).glob("*-cache")] if cache else []
    return {
        "packages": {name: _version(name) for name in _PACKAGES},
        "python": platform.python_version(),
        "system": f"{platform.platform()}, {os.cpu_count()} processors",
        "devices": [f"{device.platform}: {device.device_kind}" for device in jax.devices()],
        "float64": bool(jax.config.jax_enable_x64),
        "XLA_FLAGS": os.environ.get("XLA_FLAGS", ""),
        "variables": {key: x for key, x in sorted(os.environ.items()) if key.startswith("JAX")},
        "cache": cache,
        "cached": len(sizes),
        "cached_bytes": sum(sizes),
    }


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None
