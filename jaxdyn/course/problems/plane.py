"""Problems 21 to 39: constraints, and bodies that move in a plane."""

from jaxdyn.course.problems.problem import Problem, problem

#: By number.
PLANE: dict[int, Problem] = {
    21: problem(
        "Two masses and a rod, by differential-algebraic equations",
        "scenes.rod_on_line scenes.two_masses course.rod_or_spring.compare",
        "The rod is faster than a stiff spring; both give the correct centre of mass. On a line "
        "the constraint is linear and does not drift; unequal speeds are refused, and with "
        'drift="raw" the masses separate at constant relative speed.',
    ),
    22: problem(
        "Simple pendulum, many derivations",
        "scenes.pendulum",
        "Newton-Euler, Lagrange and constrained cartesian equations agree. The course's x points "
        "down.",
    ),
    23: problem(
        "Pendulum in cartesian coordinates",
        "scenes.pendulum analysis.constraints.tensions",
        'formulation="constrained", drift="raw", tie="square" drifts as the course intends; '
        "projection does not.",
    ),
    24: problem(
        "Pendulum by its horizontal position",
        "scenes.sideways_pendulum scenes.sideways_edge",
        "It agrees with the angle up to the level of the hinge, where the coordinate is singular.",
    ),
    25: problem(
        "Dumbbell by five differential-algebraic equations",
        "scenes.dumbbell analysis.constraints.tensions analysis.energy.integrals "
        "analysis.energy.drift",
        "Momentum, angular momentum, energy and length are conserved; their errors are reported.",
    ),
    26: problem(
        "Rotation with zero angular momentum",
        "scenes.plate scenes.plate_turn",
        "The plate ends up rotated by an angle that does not depend on the speed.",
    ),
    27: problem(
        "Cannonball on target",
        "scenes.cannonball until integrate.events.Reaches",
        "Where a shot lands, with derivatives. The problem continues 12, not 10.",
    ),
    28: problem(
        "The eight from a rough guess",
        "scenes.three_body scenes.EIGHT_GUESS scenes.EIGHT_GUESS_PERIOD scenes.EIGHT_PERIOD",
        "The guess and the scene; the orbit finder closes it to rounding.",
    ),
    29: problem(
        "Inverted pendulum on a shaking base",
        "scenes.shaken_pendulum course.upright.upright_chart drawing.stability_chart "
        "analysis.floquet.multipliers course.upright.stability_edges "
        "course.upright.averaged_limit",
        "Upright is stable between Mathieu's a_0 and b_1: for fast shaking from "
        "(A w)^2 = 2 g L on, L = 2/3 of a uniform stick.",
    ),
    30: problem(
        "Bead on a parabola",
        "scenes.bead_on_parabola",
        "By x alone, or by x and y with the wire as a constraint.",
    ),
    31: problem(
        "Double pendulum",
        "scenes.double_pendulum scenes.n_pendulum analysis.energy.drift",
        "Newton-Euler, Lagrange and constrained equations agree as far as chaos allows.",
    ),
    32: problem(
        "Braking stability of a car",
        "scenes.car scenes.wheels.braking scenes.turning_rate scenes.wheels.turning_left "
        "drawing.trajectory drawing.time_series",
        "Front wheels locked: stable. Rear wheels locked: turning grows while V^2 > mu g L.",
    ),
    33: problem(
        "Beads on a parabola and on y = c s^2",
        "scenes.bead_on_parabola scenes.bead_on_cycloid scenes.guides.cycloid",
        "y = c s^2 is a cycloid; the bead is a harmonic oscillator at any amplitude.",
    ),
    34: problem(
        "Mass in a slot on a turntable",
        "scenes.turntable scenes.turntable_limit geometry.kinematics.by_derivatives "
        "geometry.kinematics.slot_acceleration geometry.kinematics.slot_acceleration_five_terms",
        "The angle has a finite limit for any speed along the slot.",
    ),
    35: problem(
        "Cart and pendulum",
        "scenes.cart_pendulum analysis.energy.momentum",
        "Newton-Euler and Lagrange give the same equations.",
    ),
    36: problem(
        "Kinematics of the double pendulum",
        "geometry.kinematics.end_acceleration geometry.kinematics.end_acceleration_relative "
        "geometry.kinematics.by_derivatives geometry.kinematics.five_terms scenes.double_pendulum",
        "Absolute angles in polar coordinates agree with relative ones and the five-term formula.",
    ),
    37: problem(
        "Cylinder rolling off a cylinder",
        "scenes.cylinder_on_cylinder scenes.cylinders.contact_lost "
        "scenes.cylinders.friction_needed scenes.cylinders.phases_of "
        "integrate.phases.simulate_phases",
        "An inverted pendulum with 2/3 g; contact ends at cos(theta) = 4/7 for unlimited friction. "
        "With any finite coefficient it slips before.",
    ),
    38: problem(
        "Eccentric cylinder on a ramp",
        "scenes.cylinder_on_ramp scenes.cylinders.contact_lost scenes.cylinders.friction_needed "
        "scenes.cylinders.phases_of integrate.phases.simulate_phases",
        "Where the normal force vanishes the friction does not, and a flight from there may enter "
        "the ground; the chain of phases slips first. Hops without loss need level ground and no "
        "friction: the orbit finder finds them.",
    ),
    39: problem(
        "One and two skates",
        "scenes.one_skate scenes.two_skates scenes.skates.by_lagrange "
        "scenes.skates.elementary_motion scenes.skates.meeting_point",
        "Two skates turn about the meeting point of their normals; a common normal is refused.",
    ),
}
