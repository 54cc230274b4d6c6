"""Strict modes for every test: float64, no silent rank promotion, the compile cache."""

import os

os.environ.setdefault("MPLBACKEND", "Agg")

import jax

import jaxdyn

# They make the stored references with packages that the tests do not need.
collect_ignore = ["references"]

jaxdyn.configure()
jax.config.update("jax_numpy_rank_promotion", "raise")
