"""Potential energies of nine forces.

Find the potential energy of each force in space: a constant weight, a spring of rest length zero
and one with a rest length, each with one end at the origin, an inverse-square attraction, any
central force -f(r) e_r, a spring and an inverse-square attraction between two points, a constant
force in any direction, and a force -f(x) along x that depends on x alone.

Answer: m g y, k r^2 / 2, k (r - l)^2 / 2, -C / r, the integral of f over r, k (d - l)^2 / 2 and -C
/ d with the distance d of the two points, C r . n, and the integral of f over x. In each case the
work along a curve between two places is the loss of potential energy, whatever the curve.

The force is minus the gradient of the potential energy. Where it is along e_r and depends on r
alone the gradient of E(r) is E'(r) e_r, so E is the integral of the attraction over r: that gives
(b) to (e). Between two points (f, g) the force on each is minus the gradient by its own place, and
the two gradients of a function of their distance are opposite. In (a), (h) and (i) each component
depends on its own coordinate at most, and is integrated over that.

Below, the forces act on two points that move from (1, 0.5, 0.2) and (-1, 0.3, 1) to (0.4, 1.5,
-0.6) and (-0.5, -1, 2) m; a spring with one end at the origin acts on the first. They have 1 kg
each, g = 9.81 m/s^2, k = 3 N/m and l = 0.5 m. C is 2 N m^2 in (d) and (g) and 2 N in (h), where n
is (2, 1, 2) / 3. In (e), f(r) is r e^-r N with r in m, and in (i), f(x) is sin(x) N with x in m.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import Effect, drawing, effects
from jaxdyn.course.page import Page, show

PROBLEM = 15
TOPIC = "one particle"


class Bump(effects.CentralForce):
    """A central force given by f(r) = r e^-r alone; its energy is found by integration."""

    def attraction(self, r):
        return r * jnp.exp(-r)


class ForceAlongX(Effect):
    """The force -sin(x) on each point along x, from its energy."""

    velocity_dependent = False

    def potential(self, t, r, m):
        return jnp.sum(1.0 - jnp.cos(r[:, 0]))


def spring_energy(d):
    """() [J] energy of a spring of 3 N/m and 0.5 m along d (3,)."""
    return 1.5 * (jnp.linalg.norm(d) - 0.5) ** 2


def solve(page: Page) -> None:
    """Compare potentials with formulas, and the work along a curve with the loss of potential."""
    n, size = jnp.array([2.0, 1.0, 2.0]) / 3, jnp.linalg.norm
    fields = {
        "a: m g y": (effects.ConstantForce([0, -9.81, 0]), lambda r: 9.81 * r[:, 1].sum()),
        "b: k r^2 / 2": (effects.Spring(3.0), lambda r: 1.5 * size(r[0]) ** 2),
        "c: k (r - l)^2 / 2": (effects.Spring(3.0, 0.5), lambda r: 1.5 * (size(r[0]) - 0.5) ** 2),
        "d: -C / r": (effects.PowerLaw(2.0, -2.0), lambda r: -2 * (1 / size(r, axis=1)).sum()),
        "e: integral of f": (Bump(), lambda r: sum(-(1 + size(x)) * jnp.exp(-size(x)) for x in r)),
        "f: k (d - l)^2 / 2": (effects.Spring(3.0, 0.5, j=1), lambda r: spring_energy(r[1] - r[0])),
        "g: -C / d": (effects.PairGravity(2.0), lambda r: -2 / size(r[1] - r[0])),
        "h: C r . n": (effects.ConstantForce(-2.0 * n), lambda r: 2.0 * (r @ n).sum()),
        "i: integral of f(x)": (ForceAlongX(), lambda r: (1 - jnp.cos(r[:, 0])).sum()),
    }
    start = np.array([[1.0, 0.5, 0.2], [-1.0, 0.3, 1.0]])
    end = np.array([[0.4, 1.5, -0.6], [-0.5, -1.0, 2.0]])
    s, weights = np.polynomial.legendre.leggauss(60)
    s, bow = 0.5 * (s + 1)[:, None, None], np.array([0.3, 0.2, -0.4])
    path = start + s * (end - start) + np.sin(np.pi * s) * bow
    slope = (end - start) + np.pi * np.cos(np.pi * s) * bow
    for name, (effect, formula) in fields.items():
        change = effect.potential(0.0, end, np.ones(2)) - effect.potential(0.0, start, np.ones(2))
        page.number(f"{name}: change on the way", change, "J")
        printed = formula(end) - formula(start)
        page.equal(f"{name}: formula", change, printed, within=1e-13, route="printed answer")
        along = jax.jit(jax.vmap(effect.force, (None, 0, None, None)))
        force = along(0.0, path, 0 * start, np.ones(2))
        work = 0.5 * np.sum(weights[:, None, None] * force * slope)
        page.equal(f"{name}: work", -work, change, within=1e-12, route="along a curve")

    page.draw(picture, "The slope of each potential energy is the attraction f at that distance.")


def picture():
    """The potential energy over the distance, for three laws."""
    r = np.linspace(0.3, 3.0, 100)
    ax = drawing.figures.blank(6.0, 4.2).subplots()
    drawing.figures.style(ax)
    laws = {"r": effects.PowerLaw(1.0, 1.0), "1 / r^2": effects.PowerLaw(), "r e^-r": Bump()}
    for (name, law), colour in zip(laws.items(), drawing.figures.PALETTE, strict=False):
        ax.plot(r, jax.vmap(law.energy)(r), color=colour, label=f"f = {name}")
    ax.set(xlabel="r [m]", ylabel="potential energy [J]")
    ax.legend(frameon=False)
    return ax.figure


if __name__ == "__main__":
    show(solve)
