"""jaxdyn: differentiable dynamics in JAX.

A scene is a system, the effects that act on it, and a start; effects are added with ``+``:

>>> import jaxdyn
>>> from jaxdyn import effects, scenes
>>> from jaxdyn.analysis import energy
>>> jaxdyn.configure()                                     # 64-bit floats, fast loops, a cache
>>> scene = scenes.cannonball(speed=20.0) + effects.QuadraticDrag(0.05)
>>> motion = jaxdyn.simulate(scene, 2.0, rtol=1e-12)       # 200 samples, as accurate as steps
>>> round(float(motion["x"][-1]), 6)
16.532414
>>> float(energy.drift(jaxdyn.simulate(scene.without(effects.QuadraticDrag), 2.0))) < 1e-14
True

Everything is differentiable in every number, in forward and reverse mode:

>>> import jax
>>> def reach(c):
...     return jaxdyn.solve(scenes.cannonball() + effects.QuadraticDrag(c), 1.0).y1[0]
>>> round(float(jax.grad(reach)(0.1)), 6)
-13.035798

`jaxdyn list` on the command line shows the scenes, `jaxdyn run NAME` runs one. The package
`orbits` finds periodic orbits of any of them.
"""

import lazy_loader

from jaxdyn._doors import attribute_getter

__version__ = "0.3.0"

# `import jaxdyn` and the help of a command load neither JAX nor Matplotlib (SPEC 1 of Scientific
# Python): public names are imported at first use, from the modules named in the stub beside this.
_listed, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
#: Moved in version 0.3.
_MOVED = {
    "Crossings": "integrate",
    "Curve": "continuation",
    "EndError": "accuracy",
    "EquilibriumFamily": "continuation",
    "LyapunovSpectrum": "chaos",
    "Points": "scene",
}
__getattr__ = attribute_getter(
    __name__,
    _listed,
    moved=_MOVED,
    modules={"balls": "jaxdyn.ball_arithmetic"},
    folders=("ball_arithmetic", "course", "gallery", "hard", "player", "studies", "symbolic"),
)
