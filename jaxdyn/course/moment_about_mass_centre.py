"""Angular momentum balance about the centre of mass.

The basic postulate of angular momentum says that the moment of the forces about any point C is the
sum of r_i/C x m_i a_i, with the accelerations in a Newtonian frame. Show that about the centre of
mass G it is the rate of change of the sum of r_i/G x m_i v_i/G, however G accelerates.

Answer: In the sum of r_i/G x m_i a_i put a_i = a_G + a_i/G. The first part is the sum of m_i r_i/G,
which is zero, times a_G; the second is the derivative of the sum of r_i/G x m_i v_i/G, since
v_i/G x v_i/G = 0.

The numbers belong to three masses of 1, 2 and 3 kg, which are thrown from (0, 0, 0), (1, 0, 0) and
(0, 1, 0.5) m at (3, 0, 4), (3, 2, 5) and (2, 0, 4) m/s and followed for 1 s. Each two are joined by
a spring of 50 N/m with the rest length 1 m; g = 9.81 m/s^2 acts in -z, and the air exerts a drag of
0.5 N per m/s on each.
"""

import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene, drawing, effects, simulate
from jaxdyn.analysis import momenta
from jaxdyn.course.page import Page, show
from jaxdyn.formulations.newton import FreePoints

PROBLEM = 50
TOPIC = "many particles"


def solve(page: Page) -> None:
    """Throw three masses on springs through air, in space, and evaluate both sides about G."""
    places = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.5]
    velocities = [3.0, 0.0, 4.0, 3.0, 2.0, 5.0, 2.0, 0.0, 4.0]
    springs = [effects.Spring(50.0, 1.0, i=i, j=j) for i, j in ((0, 1), (1, 2), (0, 2))]
    acting = (*springs, effects.UniformGravity(9.81), effects.LinearDrag(0.5))
    scene = Scene(FreePoints([1.0, 2.0, 3.0], 3), acting, y0=jnp.array(places + velocities), t1=1.0)
    motion = simulate(scene, samples=201, rtol=1e-13)

    about_G = momenta.moment_balance(motion, momenta.centre_of_mass)["relative"]
    about_first = momenta.moment_balance(motion, lambda t, points: points.r[0])["relative"]
    what = "moment of all forces about G at t = 0: x, y and z"
    page.number(what, about_G.left[0], "N m")
    statement = "About G the moment is the rate of the angular momentum relative to G"
    page.equal(statement, about_G.left, about_G.right, within=1e-11, route="derivative of H")
    statement = "About the first mass, which accelerates as well, it is not"
    page.true(statement, not about_first.holds, route="derivative of H")
    what = "largest difference of moment and rate of H about the first mass"
    page.number(what, about_first.residual, "N m")

    r, v = motion.r, motion.ys[:, 9:].reshape(-1, 3, 3)
    arm = r - np.average(r, axis=1, weights=scene.system.m)[:, None]
    moment = np.sum(np.cross(arm, -0.5 * v), axis=1)
    statement = "About G it is the moment of the drag: springs and weight have none about G"
    page.equal(statement, about_G.left, moment, within=1e-11)

    page.draw(
        lambda: drawing.trajectory(motion, title="three masses on springs"),
        "The masses turn about a centre that weight and drag accelerate.",
    )
    page.play(motion, "Three masses on springs, thrown through air.")


if __name__ == "__main__":
    show(solve)
