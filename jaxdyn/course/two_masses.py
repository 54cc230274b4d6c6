"""Two masses on a spring, pushed by a step force.

Two masses on a frictionless line are joined by a spring at its rest length and at rest, until at
t = 0 a constant force F begins to push the second. Find the motion for any constants. Is F always
(m1 + m2) a_G? Show that a stiff spring makes both masses move like G, and say precisely in which
sense the two then are a single mass.

Answer: Yes, for any k: the forces of the spring cancel in the sum, so G moves by F t^2 / (2 M),
with the total mass M. About it the masses oscillate with the frequency sqrt(k M / (m1 m2)); they
deviate from the motion of a rigid pair by at most 2 F m1 m2 / (k M^2) and 2 F m1^2 / (k M^2), at
all times.

The numbers belong to m1 = 1 kg, m2 = 2 kg and F = 1 N, with a rest length of 1 m.

(a) With the stretch s = x2 - x1 - l0,

    m1 x1'' = k s,   m2 x2'' = -k s + F,   and so   s'' + w^2 s = F / m2,   w^2 = k M / (m1 m2).

From rest s = F (1 - cos(w t)) / (m2 w^2), and with A = F m1 m2 / (k M^2) = F / (M w^2)

    x1 = F t^2 / (2 M) - A (1 - cos(w t)),
    x2 = l0 + F t^2 / (2 M) + (m1 / m2) A (1 - cos(w t)).

(b) Yes. Adding both equations removes k s, whatever it is: (m1 + m2) a_G = F. A method of
integration that adds multiples of the rates, as all of ours do, preserves the sum, so the numerical
solution has this property to the rounding of k s, even if its steps are too long to resolve the
vibration. Only where they are so long that the method is unstable, and s grows without bound, F
drowns in that rounding.

(c) Ten times the stiffness gives a tenth of the largest distance from the rigid pair: see the
numbers, which are those of the first mass; the second is ahead by m1 / m2 times as much.

(d) "Nearly a single mass" depends on what is measured, at the time t:

    position: the first mass lags by at most the fraction (2 / (w t))^2 of the distance
        F t^2 / (2 M), the second is ahead by at most m1 / m2 times that;
    velocity: it differs by at most the fraction 1 / (w t) of F t / M (the second m1 / m2 of that);
    acceleration: it never is that of a single mass. It swings between 0 and 2 F / M for the first,
        however stiff the spring, with a frequency that grows like sqrt(k).

So the pair is one mass in position and velocity after many vibrations, w t much larger than 1, and
in its mean acceleration; the distance is at most 2 A for the first mass and 2 A m1 / m2 for the
second, at all times, and goes to zero like 1 / k.
"""

from jaxdyn import drawing, effects, scenes, simulate
from jaxdyn.course.page import Page, largest, show
from jaxdyn.scenes import springs

PROBLEM = 20
TOPIC = "many particles"


def solve(page: Page) -> None:
    """Push pairs on springs of different stiffness; compare with G and with the closed form."""
    m1, m2, F = 1.0, 2.0, 1.0
    total = m1 + m2
    motions = {
        k: simulate(scenes.two_masses(m1=m1, m2=m2, k=k, force=F), samples=401, rtol=1e-14)
        for k in (1.0, 3.0, 10.0, 30.0, 100.0, 1000.0)
    }

    def lag(t, y):
        return F * t**2 / (2 * total) - y[0]

    ts = motions[1.0].ts
    rigid = F * ts**2 / (2 * total)
    for k, motion in motions.items():
        x1, x2 = motion["x1"], motion["x2"]
        exact = springs.two_masses_exact(ts, m1=m1, m2=m2, k=k, force=F)
        page.equal(
            f"The motion is that of the closed form, k = {k:g}", motion.ys, exact, within=1e-12
        )
        G = (m1 * x1 + m2 * (x2 - 1.0)) / total
        page.equal(f"G moves by F t^2 / (2 M), k = {k:g}", G, rigid, within=1e-13)
        most = largest(motion.scene, lag).value
        page.number(f"largest lag of the first mass behind a rigid pair, k = {k:g} N/m", most, "m")
        bound = 2 * F * m1 * m2 / (k * total**2)
        page.equal(f"The largest lag is 2 F m1 m2 / (k M^2), k = {k:g}", most, bound, within=1e-12)
    page.draw(
        lambda: picture(motions, rigid),
        "Ten times the stiffness leaves a tenth of the swing about the motion of a rigid pair.",
    )
    page.play(motions, "The stiffer the spring, the more the pair is one mass.", choose="k [N/m]")


def picture(motions, rigid):
    """The lead over a rigid pair over time, for each stiffness."""
    figure = drawing.figures.blank(6.4, 4.4)
    ax = figure.subplots()
    drawing.figures.style(ax)
    for k, motion in motions.items():
        ax.plot(motion.ts, motion["x1"] - rigid, label=f"k = {k:g} N/m")
    ax.set(xlabel="t [s]", ylabel="position of the first mass minus that of a rigid pair [m]")
    ax.legend(frameon=False)
    return figure


def ask(page: Page) -> None:
    """The pair without the push, thrown, and with another mass."""
    page.ask(
        "What happens without the push, when the spring is stretched by 0.2 m?",
        "G stays where it is, and the masses swing against each other with "
        f"sqrt(k M / (m1 m2)) = {(10 * 3 / 2) ** 0.5:.3g} rad/s for k = 10 N/m.",
        scenes.two_masses(k=10.0).without(effects.StepForce).starting([0.0, 1.2, 0.0, 0.0]),
    )
    page.ask(
        "What happens when the first mass weighs a hundred times less?",
        "The lag of the first mass is at most 2 F m1 m2 / (k M^2) = "
        f"{2 * 0.01 * 2.0 / (10 * 2.01**2):.2g} m: the spring has little to pull.",
        scenes.two_masses(m1=0.01, k=10.0),
    )


if __name__ == "__main__":
    show(solve)
