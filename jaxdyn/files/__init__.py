"""What is written and read: paths checked before the work, scenes as JSON, motions as tables.

May import: `analysis` and what is below it. Its `__init__` imports nothing, since command lines
check paths before they load JAX.
"""
