"""The commands that change a parameter: families, bifurcation diagrams, curves of bifurcations.

One more command is one more file, and a call of `add` in `orbits/cli/app.py`.
"""

__all__: list[str] = []
