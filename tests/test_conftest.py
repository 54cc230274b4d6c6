"""A run of the tests that cannot work says why."""

import os
import subprocess
import sys
from pathlib import Path


def test_flags_that_xla_refuses_end_the_run_with_its_words():
    flags = "--xla_nonsense=1"
    # Workers would die one after the other, and their last words be lost.
    command = [sys.executable, "-m", "pytest", "-n", "2", "tests/test_sizes.py"]
    done = subprocess.run(
        command,
        cwd=Path(__file__).parents[1],
        env=os.environ | {"XLA_FLAGS": flags},
        text=True,
        capture_output=True,
    )
    assert done.returncode == 3
    assert f"XLA does not start with XLA_FLAGS='{flags}" in done.stderr
    assert f"Unknown flag in XLA_FLAGS: {flags}" in done.stderr
