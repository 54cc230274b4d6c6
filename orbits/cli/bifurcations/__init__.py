"""The commands that change a parameter: families, bifurcation diagrams, curves of bifurcations.

To add a command, write a file, and a call of `add` in `orbits/cli/app.py`.
"""

__all__: list[str] = []
