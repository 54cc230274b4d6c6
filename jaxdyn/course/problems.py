"""The 61 problems of the course, each with the names that answer it and a summary of the answer.

Names are public ones below `jaxdyn`: ``scenes.pendulum`` is ``jaxdyn.scenes.pendulum``. Periodic
motions and targets (11 b, 27, 28, 38, 43 b) need root finding on top of these scenes, which is what
the orbit finder is for.
"""

from typing import NamedTuple


class Problem(NamedTuple):
    """A problem: its title, the public names that answer it, and a summary of the answer."""

    title: str
    names: tuple[str, ...]
    answer: str


def _problem(title: str, names: str, answer: str) -> Problem:
    return Problem(title, tuple(names.split()), answer)


PROBLEMS: dict[int, Problem] = {
    1: _problem(
        "One particle, any forces",
        "scenes.particle simulate drawing.trajectory drawing.animate",
        "Effects are added to a scene with +.",
    ),
    2: _problem(
        "Vectors: lines, tetrahedra, rods",
        "geometry.vectors.closest_points geometry.vectors.tetrahedron_volume "
        "geometry.vectors.rod_tensions",
        "|n . (c - a)| / |n| with n = (b - a) x (d - c); parallel and coplanar cases are flagged.",
    ),
    3: _problem(
        "Simple equations solved three ways, and how accurate that is",
        "scenes.oscillator scenes.pendulum scenes.lorenz accuracy.convergence.fixed_steps "
        "accuracy.convergence.halvings simulate accuracy.by_halving accuracy.estimate "
        "accuracy.by_second_method accuracy.by_tangents accuracy.work_precision.work_precision "
        "drawing.judgement",
        "Halving the step gives error and order without the exact solution: order 1 for Euler's "
        "method. Solvers control the error of one step, and these add up: "
        "drawing.judgement draws the error against the tolerance.",
    ),
    4: _problem(
        "Cross product by geometry and by components",
        "geometry.vectors.cross geometry.vectors.cross_by_geometry "
        "geometry.vectors.cross_by_indices",
        "The geometric definition is distributive over sums, which gives the components.",
    ),
    5: _problem(
        "Reading: vectors, components, units",
        "geometry.vectors geometry.indices",
        "Nothing to compute; these are the tools of the named chapters.",
    ),
    6: _problem(
        "Mass on a spring with rest length",
        "scenes.spring_mass analysis.energy.drift",
        "Every limiting case of 6 c holds: parabola, vertical, radial, ellipse, circle, plane.",
    ),
    7: _problem(
        "A drawn shape moved and turned",
        "scenes.moved_shape formulations.prescribed.Prescribed drawing.animate",
        "A house on a figure of eight, or any drawing; all distances within it are preserved.",
    ),
    8: _problem(
        "Straight motion in polar coordinates",
        "scenes.polar_particle scenes.straightness",
        "The path is straight to the tolerance, also if it passes the origin at a micrometre.",
    ),
    9: _problem(
        "Cannonball with linear drag",
        "scenes.cannonball scenes.ballistics.cannonball_linear_exact "
        "scenes.ballistics.flight_time scenes.ballistics.best_angle drawing.trajectory",
        "Fast shots tend to a triangle, and the best angle to 0, like log(u^2) / u.",
    ),
    10: _problem(
        "Mass on a spring of rest length zero, in space",
        "scenes.hanging_spring scenes.springs.hanging_spring_exact scenes.springs.wildness "
        "drawing.projections",
        "No wild motions: every motion is an ellipse with the same period.",
    ),
    11: _problem(
        "Central forces",
        "scenes.power_law scenes.central_orbit scenes.circular_speed scenes.apsidal_angle "
        "scenes.fewest_loops",
        "For F = k / r all circular orbits have the same speed; orbits are rosettes, closed after "
        "q loops if the apsidal angle is pi p / q.",
    ),
    12: _problem(
        "Cannonball with quadratic drag, and the work of the drag",
        "scenes.cannonball analysis.ledger.with_work analysis.energy.energy",
        "Work and change of energy agree better as the tolerance shrinks. The course gives no "
        "coefficient: take 1 kg/m, and others.",
    ),
    13: _problem(
        "Mass on two springs: statics, dynamics, stability",
        "scenes.two_springs equilibria linearize simulate",
        "One to five equilibria with two springs and weight, with a proof that the list is "
        "complete; a single spring without weight has a circle of them. The eigenvalues are the "
        "rates of the simulated decay.",
    ),
    14: _problem(
        "Rate of change of angular momentum of a particle",
        "analysis.momenta.moment_balance analysis.momenta.angular_momentum_about",
        "a always holds; b if C is at rest or moves parallel to P's velocity; c if C has no "
        "acceleration, or one along PC.",
    ),
    15: _problem(
        "Potential energies",
        "effects.UniformGravity effects.Spring effects.CentralForce effects.PowerLaw "
        "effects.PairGravity effects.ConstantForce analysis.energy.potential",
        "A potential suffices: the force is minus its gradient. An effect with only a force is "
        "treated as having no potential.",
    ),
    16: _problem(
        "Two and three bodies on circles",
        "scenes.two_body scenes.nbody.two_body_period scenes.three_body_circular "
        "scenes.nbody.three_body_rate",
        "T = 2 pi sqrt(d^3 / (G (m1 + m2))); sqrt(G m / (sqrt(3) R^3)), unstable. d = 3 is a "
        "diameter.",
    ),
    17: _problem(
        "Montgomery's eight",
        "scenes.three_body simulate",
        "The printed start closes to its digits; small perturbations stay close, larger ones break "
        "the orbit up.",
    ),
    18: _problem(
        "Konig's theorem",
        "analysis.momenta.kinetic_split analysis.momenta.power_balances",
        "a: plus the energy relative to G. b: always. c: not always, since external forces also do "
        "work relative to G.",
    ),
    19: _problem(
        "Rate of change of angular momentum of a system",
        "analysis.momenta.moment_balance analysis.momenta.centre_of_mass",
        "a always; b if C is at rest or moves parallel to G; c if C is G, has no acceleration, or "
        "one along CG.",
    ),
    20: _problem(
        "Two masses, a spring and a step force",
        "scenes.two_masses scenes.springs.two_masses_exact analysis.momenta.centre_of_mass",
        "F = m a_G for any k; both masses stay within O(F / k) of the motion of a rigid rod.",
    ),
    21: _problem(
        "Two masses and a rod, by differential-algebraic equations",
        "scenes.rod_on_line scenes.two_masses course.rod_or_spring.compare",
        "The rod is faster than a stiff spring; both give the correct centre of mass. On a line "
        "the constraint is linear and does not drift; unequal speeds are refused, and with "
        'drift="raw" the masses separate at constant relative speed.',
    ),
    22: _problem(
        "Simple pendulum, many derivations",
        "scenes.pendulum",
        "Newton-Euler, Lagrange and constrained cartesian equations agree. The course's x points "
        "down.",
    ),
    23: _problem(
        "Pendulum in cartesian coordinates",
        "scenes.pendulum analysis.constraints.tensions",
        'formulation="constrained", drift="raw", tie="square" drifts as the course intends; '
        "projection does not.",
    ),
    24: _problem(
        "Pendulum by its horizontal position",
        "scenes.sideways_pendulum scenes.sideways_edge",
        "It agrees with the angle up to the level of the hinge, where the coordinate is singular.",
    ),
    25: _problem(
        "Dumbbell by five differential-algebraic equations",
        "scenes.dumbbell analysis.constraints.tensions analysis.energy.integrals "
        "analysis.energy.drift",
        "Momentum, angular momentum, energy and length are conserved; their errors are reported.",
    ),
    26: _problem(
        "Rotation with zero angular momentum",
        "scenes.plate scenes.plate_turn",
        "The plate ends up rotated by an angle that does not depend on the speed.",
    ),
    27: _problem(
        "Cannonball on target",
        "scenes.cannonball until integrate.events.Reaches",
        "Where a shot lands, with derivatives. The problem continues 12, not 10.",
    ),
    28: _problem(
        "The eight from a rough guess",
        "scenes.three_body scenes.EIGHT_GUESS scenes.EIGHT_GUESS_PERIOD scenes.EIGHT_PERIOD",
        "The guess and the scene; the orbit finder closes it to rounding.",
    ),
    29: _problem(
        "Inverted pendulum on a shaking base",
        "scenes.shaken_pendulum course.upright.upright_chart drawing.stability_chart "
        "analysis.floquet.multipliers course.upright.stability_edges "
        "course.upright.averaged_limit",
        "Upright is stable between Mathieu's a_0 and b_1: for fast shaking from "
        "(A w)^2 = 2 g L on, L = 2/3 of a uniform stick.",
    ),
    30: _problem(
        "Bead on a parabola",
        "scenes.bead_on_parabola",
        "By x alone, or by x and y with the wire as a constraint.",
    ),
    31: _problem(
        "Double pendulum",
        "scenes.double_pendulum scenes.n_pendulum analysis.energy.drift",
        "Newton-Euler, Lagrange and constrained equations agree as far as chaos allows.",
    ),
    32: _problem(
        "Braking stability of a car",
        "scenes.car scenes.wheels.braking scenes.turning_rate scenes.wheels.turning_left "
        "drawing.trajectory drawing.time_series",
        "Front wheels locked: stable. Rear wheels locked: turning grows while V^2 > mu g L.",
    ),
    33: _problem(
        "Beads on a parabola and on y = c s^2",
        "scenes.bead_on_parabola scenes.bead_on_cycloid scenes.guides.cycloid",
        "y = c s^2 is a cycloid; the bead is a harmonic oscillator at any amplitude.",
    ),
    34: _problem(
        "Mass in a slot on a turntable",
        "scenes.turntable scenes.turntable_limit geometry.kinematics.by_derivatives "
        "geometry.kinematics.slot_acceleration geometry.kinematics.slot_acceleration_five_terms",
        "The angle has a finite limit for any speed along the slot.",
    ),
    35: _problem(
        "Cart and pendulum",
        "scenes.cart_pendulum analysis.energy.momentum",
        "Newton-Euler and Lagrange give the same equations.",
    ),
    36: _problem(
        "Kinematics of the double pendulum",
        "geometry.kinematics.end_acceleration geometry.kinematics.end_acceleration_relative "
        "geometry.kinematics.by_derivatives geometry.kinematics.five_terms scenes.double_pendulum",
        "Absolute angles in polar coordinates agree with relative ones and the five-term formula.",
    ),
    37: _problem(
        "Cylinder rolling off a cylinder",
        "scenes.cylinder_on_cylinder scenes.rolling.contact_lost scenes.rolling.friction_needed "
        "scenes.rolling.phases_of integrate.phases.simulate_phases",
        "An inverted pendulum with 2/3 g; contact ends at cos(theta) = 4/7 for unlimited friction. "
        "With any finite coefficient it slips before.",
    ),
    38: _problem(
        "Eccentric cylinder on a ramp",
        "scenes.cylinder_on_ramp scenes.rolling.contact_lost scenes.rolling.friction_needed "
        "scenes.rolling.phases_of integrate.phases.simulate_phases",
        "Where the normal force vanishes the friction does not, and a flight from there may enter "
        "the ground; the chain of phases slips first. Hops without loss need level ground and no "
        "friction: the orbit finder finds them.",
    ),
    39: _problem(
        "One and two skates",
        "scenes.one_skate scenes.two_skates scenes.skates.by_lagrange "
        "scenes.skates.elementary_motion scenes.skates.meeting_point",
        "Two skates turn about the meeting point of their normals; a common normal is refused.",
    ),
    40: _problem(
        "Practice with dyadics",
        "geometry.rotations.tensor_in_world geometry.rotations.tensor_in_body "
        "geometry.rotations.matrix_between geometry.rotations.orthonormalise",
        "Reading; tensors and their components in two bases.",
    ),
    41: _problem(
        "Index notation",
        "geometry.indices.check_indices geometry.indices.evaluate_indices "
        "geometry.indices.kronecker geometry.indices.levi_civita",
        "The value of each expression, or the reason why it is invalid. In the text read b_j for "
        "the last b_3, and b_j e_j for b_i e_j.",
    ),
    42: _problem(
        "Rotations: one vector, one tensor, two bases",
        "geometry.rotations.matrix_between geometry.rotations.rotate "
        "geometry.rotations.tensor_in_body geometry.rotations.tensor_in_world "
        "geometry.indices.evaluate_indices",
        "r*_B = r whatever R is, R_B = R, and A = R in j.",
    ),
    43: _problem(
        "Triple pendulum, four-bar linkage and more",
        "scenes.triple_pendulum scenes.n_pendulum scenes.four_bar scenes.pinned_chain "
        "scenes.skate_chain",
        "Three formulations and closed loops agree; links that cannot close are refused.",
    ),
    44: _problem(
        "Euler's theorem on rotations",
        "geometry.rotations.axis_angle_from_matrix",
        "A proof to read; every rotation matrix has an axis and an angle.",
    ),
    45: _problem(
        "Two quarter turns",
        "geometry.rotations.rotate geometry.rotations.compose_axis_angle "
        "geometry.rotations.axis_angle_from_matrix",
        "120 degrees about (1, 1, 1): x to y, y to z, z to x.",
    ),
    46: _problem(
        "vecrot, rotmat, and back",
        "geometry.rotations.rotate geometry.rotations.matrix_from_axis_angle "
        "geometry.rotations.axis_angle_from_matrix",
        "Axis and angle are recovered to rounding, also at 0 and at pi.",
    ),
    47: _problem(
        "A box turned about a line",
        "scenes.turned_box scenes.box formulations.prescribed.Prescribed drawing.animate",
        "120 degrees about (1, 1, 1) permutes the axes.",
    ),
    48: _problem(
        "Euler angles",
        "geometry.euler.matrix_from_euler geometry.euler.euler_from_matrix",
        'Fixed "xyz" and body "ZYX" are one rotation, R_z R_y R_x.',
    ),
    49: _problem(
        "A box animated by Euler angles",
        "scenes.moved_box formulations.prescribed.Prescribed drawing.animate",
        "Three oscillating angles, or any functions of time; with two of them zero, roll, pitch or "
        "yaw alone.",
    ),
    50: _problem(
        "Angular momentum balance about G",
        "analysis.momenta.moment_balance analysis.momenta.centre_of_mass",
        "True about G for any acceleration of G.",
    ),
    51: _problem(
        "Euler equations in full",
        "scenes.box scenes.free_body geometry.inertia.equivalent_box geometry.inertia.is_flat",
        "Moments 1, 2, 3 are those of a flat plate, not of a thick box. It flips.",
    ),
    52: _problem(
        "Euler equations in the body's axes",
        "scenes.free_body formulations.rigid.pose analysis.energy.along drawing.time_series",
        "Spin about the middle axis is unstable, about the others stable.",
    ),
    53: _problem(
        "Rigid bodies by matrix, quaternion and Euler angles",
        "scenes.free_body scenes.box scenes.feynman_plate formulations.rigid.pose",
        "All representations agree. In the text a dot is missing over omega and one over R.",
    ),
    54: _problem(
        "Static and dynamic balance",
        "geometry.balance.bearing_forces geometry.inertia.principal geometry.inertia.point",
        "Three axes, in both directions, for an asymmetric body; the plus sign is balanced; one "
        "bearing can carry the whole force.",
    ),
    55: _problem(
        "Three satellites",
        "scenes.satellite scenes.satellites.satellite_a scenes.satellites.satellite_b "
        "scenes.satellites.satellite_c scenes.satellites.antenna_trace geometry.inertia.principal",
        "No two moments of A are equal (0.527, 0.795, 1.051): 55 iii is wrong, 57 A i is right.",
    ),
    56: _problem(
        "Feynman's plate",
        "scenes.feynman_plate analysis.precession.wobble_and_spin "
        "analysis.precession.free_precession",
        "Two wobbles for one spin: the book has the ratio inverted.",
    ),
    57: _problem(
        "Claims about the satellites",
        "course.satellite_claims.satellite_claims scenes.satellite geometry.inertia.principal "
        "analysis.precession.free_attitude analysis.energy.angular_momentum",
        "A ii is false (for the smallest moment), and so is A iii: between the wobbles there are "
        "motions that flip just once. B i to iii and C i, ii are true.",
    ),
    58: _problem(
        "Steady precession of axisymmetric bodies in space",
        "analysis.precession.free_attitude analysis.precession.free_precession scenes.satellite "
        "scenes.satellites.antenna_trace",
        "Yes: every free motion is one, exp(t H / I_1) R_0 exp(t omega_s e_3).",
    ),
    59: _problem(
        "Steady precession of a top",
        "analysis.precession.top_roots analysis.precession.precession_residual "
        "course.sleeping_top.critical_spin course.sleeping_top.slowest_relative_spin scenes.top "
        "analysis.precession.tilts analysis.steady.linearize_steady",
        "A quadratic equation in omega_p; the slowest total spin upright is 2 sqrt(I m g d) / I_3, "
        "and the slowest relative spin is different. Tops also nutate.",
    ),
    60: _problem(
        "Steady precession of a disk on a plane",
        "analysis.precession.rolling_disk_circle analysis.precession.sliding_disk_roots "
        "analysis.precession.frictionless_rolling_disk analysis.precession.disk_residuals "
        "scenes.rolling_disk analysis.steady.linearize_steady",
        "Without slip, without friction, and without both: omega_p^2 = m g r / (I sin(theta)), "
        "omega_3 = 0. The course calls the lean both theta and phi.",
    ),
    61: _problem(
        "Spinning top in space",
        "scenes.top analysis.precession.top_roots course.sleeping_top.critical_spin "
        "course.sleeping_top.critical_spin_by_linearisation "
        "course.sleeping_top.critical_spin_by_simulation analysis.steady.linearize_steady",
        "Steady starts stay steady; the critical total spin is the limit of stability, found in "
        "three ways.",
    ),
}
