"""The figure-eight from a rough guess.

Three equal bodies attract each other by gravity (G = 1), and a rough start and a period of about 8
are given. Correct both until the motion closes on itself, and follow it for more than five
periods. Is it the figure-eight? Which other periodic motions of three bodies can be found?

Answer: Asking only that the motion closes leads to a neighbour, in which three bodies run on three
slightly different eights and which is weakly unstable (T = 7.9592). With the condition that each
body is in the next one's place after T / 3 the search ends on Montgomery's eight (T = 7.9611),
which is stable; another start closes to the "moth".

The differences between y(T) and the start, or the same with the bodies exchanged after T / 3, are
equations for the 12 numbers of the start and T. Their derivatives come with the integration, so
Newton's method corrects all of them at once, by the smallest change where the equations leave some
free, as they do for the place, the direction and the scale. With the energy E, T |E|^(3/2) does not
depend on the scale. The distance from a choreography is the largest difference between y(T / 3) and
the start with the bodies exchanged, in parts of the sizes. The moth starts at (-1, 0), (1, 0), (0,
0) with (0.46444, 0.39606) twice and (-0.92888, -0.79212), as published.
"""

import numpy as np

import orbits
from jaxdyn import scenes, simulate
from jaxdyn.course.page import Page, show

PROBLEM = 28
TOPIC = "many particles"

MOTH = (-1.0, 0.0, 1.0, 0.0, 0.0, 0.0)  # Suvakov and Dmitrasinovic (2013), with 5 digits
MOTH += (0.46444, 0.39606, 0.46444, 0.39606, -0.92888, -0.79212)


def solve(page: Page) -> None:
    """Close the motion plainly, then as a choreography; find out which orbit each is."""
    scene = scenes.three_body(scenes.EIGHT_GUESS, t1=scenes.EIGHT_GUESS_PERIOD)
    plain = orbits.find(scene)
    eight = orbits.find(plain.scene, closing=orbits.choreography(3))
    moth = orbits.find(scene, MOTH, 14.9)
    found = {"the neighbour": plain, "the eight": eight, "the moth": moth}
    motions = {}
    for name, orbit in found.items():
        page.number(f"period of {name}", orbit.period)
        page.number(f"closing error of {name}", orbit.residual)
        motions[name] = simulate(orbit.scene, 6 * orbit.period, samples=600, rtol=1e-14)
        statement = f"After six periods {name} is where it started"
        end = motions[name].ys[-1]
        page.equal(statement, end, orbit.y0, within=1e-11, route="simulation of six periods")

    for name in ("the neighbour", "the eight"):
        places, speeds = np.split(np.asarray(found[name].y0), 2)
        page.number(f"corrected start of {name}: x1, y1, x2, y2, x3, y3", places)
        page.number(f"corrected start of {name}: their velocities", speeds)

    printed = orbits.find(scenes.three_body(), closing=orbits.choreography(3))
    first, second, known = (orbits.identify(orbit) for orbit in (plain, eight, printed))
    page.number("T |E|^(3/2) of the neighbour", first.scale_free)
    page.number("T |E|^(3/2) of the eight", second.scale_free)
    page.number("distance of the neighbour from a choreography", first.permutation_error)
    statement = "T |E|^(3/2), which no change of scale changes, is that of the printed eight"
    page.equal(statement, second.scale_free, known.scale_free, within=1e-11, route="problem 17")
    turns = np.array(orbits.stability(eight).exponents)
    statement = "The eight is stable, with the rotation numbers that are known of it"
    page.equal(statement, turns, [0.00842272, 0.29809253], within=1e-8, route="Simo (2002)")
    growth = abs(orbits.stability(plain).multipliers).max()
    page.number("growth of a small error in one period of the neighbour", growth)

    look = "The neighbour closes as well, on three curves; the eight has only one."
    page.draw(
        lambda: orbits.drawing.orbits(list(found.values()), titles=list(found), title=""), look
    )
    look = "Only in the eight do the bodies follow each other on one curve."
    page.play({name: motions[name] for name in ("the neighbour", "the eight")}, look)
    slower = simulate(moth.scene, 2 * moth.period, samples=600, rtol=1e-14)
    page.play(slower, "All three bodies of the moth run on curves of their own.")


if __name__ == "__main__":
    show(solve)
