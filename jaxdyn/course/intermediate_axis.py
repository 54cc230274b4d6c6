"""Spin about the three principal axes.

Write Euler's equations in the axes of the body, where the inertia is constant: three equations for
the three components of the angular velocity, here with the moments 1, 2 and 3. Solve them for small
deviations from a spin about each axis: about which is it stable? Compare with the full equations.

Answer: About the axes of the smallest and the largest moment deviations oscillate, at 0.577 and 1
rad/s for a spin of 1 rad/s; about the middle axis they grow like exp(0.577 t). From (1, 0, 1) the
motion is omega = (cn t, sn t, dn t) with the parameter 1/3, Jacobi's functions.

(a) The angular momentum has the components I_i omega_i in the body's axes e_i', which turn with
omega. It does not change in space: H' + omega x H = 0, with H' in these axes, which reads

    I1 omega1' = (I2 - I3) omega2 omega3     omega1' = -omega2 omega3
    I2 omega2' = (I3 - I1) omega3 omega1     omega2' = omega3 omega1
    I3 omega3' = (I1 - I2) omega1 omega2     omega3' = -omega1 omega2 / 3

on the right for the moments 1, 2 and 3 kg m^2.

(b) `euler` in the code has these equations; `simulate(ode(euler, start, t1))` integrates them. From
(1, 0, 1) rad/s the solution is compared with Jacobi's functions for 30 s.

(c, d) Deviations of 0.001 rad/s in each component from a spin of 1 rad/s about x', y' and z' are in
the picture, for 30 s.

(e) About x' and z' they stay as small as they began. About y', the axis of the middle moment, they
grow until the body flips over. To first order the two deviations across the spin about axis i obey
w'' = w omega^2 (I_j - I_i) (I_i - I_k) / (I_j I_k): positive only for the middle moment.

(f) The full equations, with the attitude R, give omega in fixed axes. R^T omega is its components
in the body's axes, and these are the solution of Euler's equations, here from (1, 0, 1) rad/s for
30 s.
"""

import jax.numpy as jnp
import numpy as np
from scipy.special import ellipj

from jaxdyn import drawing, linearize, ode, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, show
from jaxdyn.formulations import rigid

PROBLEM = 52
TOPIC = "rigid bodies in space"


def euler(t, omega):
    """Rates of the angular velocity in the body's axes, for the moments 1, 2 and 3."""
    first, second, third = omega
    return [(2 - 3) * second * third / 1, (3 - 1) * third * first / 2, (1 - 2) * first * second / 3]


def solve(page: Page) -> None:
    """Disturb spins about each axis; compare with Jacobi's functions and the full equations."""
    spins, motions = {}, []
    for i, name in enumerate("xyz"):
        omega0 = np.eye(3)[i] + 1e-3
        about = ode(euler, omega0, 30.0, names=["omega1", "omega2", "omega3"])
        motion = simulate(about, samples=400, rtol=1e-12)
        motions.append(motion)
        found = linearize(about, np.eye(3)[i]).eigenvalues
        fastest = found[np.argmax(np.abs(found))]
        what = "growth" if fastest.real > abs(fastest.imag) else "frequency"
        rate = f"{what} of small deviations from a spin of 1 rad/s about {name}'"
        page.number(rate, abs(fastest), "1/s")
        square = [-2 / 6, 1 / 3, -1.0][i]  # (I_j - I_i) (I_i - I_k) / (I_j I_k)
        statement = f"e: about {name}' the exponent's square is (I_j - I_i) (I_i - I_k) / (I_j I_k)"
        page.equal(statement, complex(fastest) ** 2, complex(square), within=1e-12)
        spins[f"about {name}'"] = simulate(scenes.free_body(omega0), 30.0, samples=400, rtol=1e-12)
    page.draw(
        lambda: picture(motions),
        "Small deviations stay small about x' and z'; about y' they grow and it flips.",
    )

    start = jnp.array([1.0, 0.0, 1.0])
    short = simulate(ode(euler, start, 30.0), samples=400, rtol=1e-12)
    sn, cn, dn, _ = ellipj(np.asarray(short.ts), 1 / 3)
    page.equal(
        "b: From (1, 0, 1) omega is (cn t, sn t, dn t)",
        short.ys,
        np.stack([cn, sn, dn], axis=1),
        within=1e-11,
    )
    whole = simulate(scenes.free_body(start), 30.0, samples=400, rtol=1e-12)
    pose = energy.along(rigid.pose, whole)
    turned = jnp.einsum("sji,sj->si", pose.R_wb, pose.omega_w)
    same = "f: R^T omega of the full equations is the solution of Euler's"
    page.equal(same, turned, short.ys, within=1e-11, route="second formulation")

    page.play(spins, "Only the spin about y' flips over.", choose="spin")


def picture(motions):
    """The deviations of omega over time, for each spin."""
    figure = drawing.figures.blank(9.0, 3.0)
    for i, (name, motion) in enumerate(zip("xyz", motions, strict=True)):
        ax = figure.add_subplot(1, 3, i + 1, xlabel="t [s]", title=f"spin about {name}'")
        drawing.figures.style(ax)
        ax.plot(
            motion.ts, np.asarray(motion.ys) - np.eye(3)[i], label=["omega1", "omega2", "omega3"]
        )
    drawing.figures.legend_below(figure, figure.axes[0].get_lines())
    return figure


def ask(page: Page) -> None:
    """Smaller deviations, equal moments."""
    growth = page["growth of small deviations from a spin of 1 rad/s about y'"]
    page.ask(
        "What happens about y' when the deviations are a thousand times smaller?",
        "It flips over as well, later: small deviations take ln(1000) / "
        f"{growth:.3g} = {np.log(1000) / growth:.3g} s to grow by a factor of a thousand.",
        scenes.free_body(np.array([0.0, 1.0, 0.0]) + 1e-6, t1=60.0),
    )
    page.ask(
        "What happens when it spins about none of its axes, at (1, 1, 1) rad/s?",
        "It tumbles: omega wanders in space and in the body, while the angular momentum, among the "
        "vectors, does not move.",
        scenes.free_body((1.0, 1.0, 1.0), t1=30.0),
    )


if __name__ == "__main__":
    show(solve)
