"""jaxdyn: differentiable dynamics in JAX.

A scene is what moves, what acts on it, and a start; it is composed with ``+``:

>>> import jaxdyn
>>> from jaxdyn import effects, energy, scenes
>>> jaxdyn.configure()                                     # 64-bit floats, fast loops, a cache
>>> scene = scenes.cannonball(speed=20.0) + effects.QuadraticDrag(0.05)
>>> motion = jaxdyn.simulate(scene, 2.0, rtol=1e-12)       # 200 samples, each as good as a step
>>> round(float(motion["x"][-1]), 6)
16.532414
>>> float(energy.drift(jaxdyn.simulate(scene.without(effects.QuadraticDrag), 2.0))) < 1e-14
True

Gradients go through all of it, in every number, in forward and reverse mode:

>>> import jax
>>> from jaxdyn.simulate import solve
>>> def reach(c):
...     return solve(scenes.cannonball() + effects.QuadraticDrag(c), 1.0).y1[0]
>>> round(float(jax.grad(reach)(0.1)), 6)
-13.035798

`jaxdyn list` on the command line shows the scenes, `jaxdyn run NAME` runs one. The package
`orbits` finds periodic motions of any of them.
"""

from jaxdyn import accuracy as accuracy
from jaxdyn import approaches as approaches
from jaxdyn import effects as effects
from jaxdyn import energy as energy
from jaxdyn import ensemble as ensemble
from jaxdyn import events as events
from jaxdyn import regularised as regularised
from jaxdyn import scenes as scenes
from jaxdyn import solvers as solvers
from jaxdyn import watches as watches
from jaxdyn._config import configure as configure
from jaxdyn.scene import Effect as Effect
from jaxdyn.scene import Points as Points
from jaxdyn.scene import Scene as Scene
from jaxdyn.scene import System as System
from jaxdyn.simulate import Trajectory as Trajectory
from jaxdyn.simulate import simulate as simulate
from jaxdyn.status import IntegrationError as IntegrationError
from jaxdyn.status import Status as Status
