"""Problems 1 to 20: particles, systems of particles, and the vectors that they need."""

from jaxdyn.course.problems.problem import Problem, problem

#: By number.
PARTICLES: dict[int, Problem] = {
    1: problem(
        "One particle, any forces",
        "scenes.particle simulate drawing.trajectory drawing.animate",
        "Effects are added to a scene with +.",
    ),
    2: problem(
        "Vectors: lines, tetrahedra, rods",
        "geometry.vectors.closest_points geometry.vectors.tetrahedron_volume "
        "geometry.vectors.rod_tensions",
        "|n . (c - a)| / |n| with n = (b - a) x (d - c); parallel and coplanar cases are flagged.",
    ),
    3: problem(
        "Simple equations solved three ways, and how accurate that is",
        "scenes.oscillator scenes.pendulum scenes.lorenz accuracy.convergence.fixed_steps "
        "accuracy.convergence.halvings simulate accuracy.by_halving accuracy.estimate "
        "accuracy.by_second_method accuracy.by_tangents accuracy.work_precision.work_precision "
        "drawing.judgement",
        "Halving the step gives error and order without the exact solution: order 1 for Euler's "
        "method. Solvers control the error of one step, and these add up: "
        "drawing.judgement draws the error against the tolerance.",
    ),
    4: problem(
        "Cross product by geometry and by components",
        "geometry.vectors.cross geometry.vectors.cross_by_geometry "
        "geometry.vectors.cross_by_indices",
        "The geometric definition is distributive over sums, which gives the components.",
    ),
    5: problem(
        "Reading: vectors, components, units",
        "geometry.vectors geometry.indices",
        "Nothing to compute; these are the tools of the named chapters.",
    ),
    6: problem(
        "Mass on a spring with rest length",
        "scenes.spring_mass analysis.energy.drift",
        "Every limiting case of 6 c holds: parabola, vertical, radial, ellipse, circle, plane.",
    ),
    7: problem(
        "A drawn shape moved and turned",
        "scenes.moved_shape formulations.prescribed.Prescribed drawing.animate",
        "A house on a figure of eight, or any drawing; all distances within it are preserved.",
    ),
    8: problem(
        "Straight motion in polar coordinates",
        "scenes.polar_particle scenes.straightness",
        "The path is straight to the tolerance, also if it passes the origin at a micrometre.",
    ),
    9: problem(
        "Cannonball with linear drag",
        "scenes.cannonball scenes.ballistics.cannonball_linear_exact "
        "scenes.ballistics.flight_time scenes.ballistics.best_angle drawing.trajectory",
        "Fast shots tend to a triangle, and the best angle to 0, like log(u^2) / u.",
    ),
    10: problem(
        "Mass on a spring of rest length zero, in space",
        "scenes.hanging_spring scenes.springs.hanging_spring_exact scenes.springs.wildness "
        "drawing.projections",
        "No wild motions: every motion is an ellipse with the same period.",
    ),
    11: problem(
        "Central forces",
        "scenes.power_law scenes.central_orbit scenes.circular_speed scenes.apsidal_angle "
        "scenes.fewest_loops",
        "For F = k / r all circular orbits have the same speed; orbits are rosettes, closed after "
        "q loops if the apsidal angle is pi p / q.",
    ),
    12: problem(
        "Cannonball with quadratic drag, and the work of the drag",
        "scenes.cannonball analysis.ledger.with_work analysis.energy.energy",
        "Work and change of energy agree better as the tolerance shrinks. The course gives no "
        "coefficient: take 1 kg/m, and others.",
    ),
    13: problem(
        "Mass on two springs: statics, dynamics, stability",
        "scenes.two_springs equilibria linearize simulate",
        "One to five equilibria with two springs and weight, with a proof that the list is "
        "complete; a single spring without weight has a circle of them. The eigenvalues are the "
        "rates of the simulated decay.",
    ),
    14: problem(
        "Rate of change of angular momentum of a particle",
        "analysis.momenta.moment_balance analysis.momenta.angular_momentum_about",
        "a always holds; b if C is at rest or moves parallel to P's velocity; c if C has no "
        "acceleration, or one along PC.",
    ),
    15: problem(
        "Potential energies",
        "effects.UniformGravity effects.Spring effects.CentralForce effects.PowerLaw "
        "effects.PairGravity effects.ConstantForce analysis.energy.potential",
        "A potential suffices: the force is minus its gradient. An effect with only a force is "
        "treated as having no potential.",
    ),
    16: problem(
        "Two and three bodies on circles",
        "scenes.two_body scenes.nbody.two_body_period scenes.three_body_circular "
        "scenes.nbody.three_body_rate",
        "T = 2 pi sqrt(d^3 / (G (m1 + m2))); sqrt(G m / (sqrt(3) R^3)), unstable. d = 3 is a "
        "diameter.",
    ),
    17: problem(
        "Montgomery's eight",
        "scenes.three_body simulate",
        "The printed start closes to its digits; small perturbations stay close, larger ones break "
        "the orbit up.",
    ),
    18: problem(
        "Konig's theorem",
        "analysis.momenta.kinetic_split analysis.momenta.power_balances",
        "a: plus the energy relative to G. b: always. c: not always, since external forces also do "
        "work relative to G.",
    ),
    19: problem(
        "Rate of change of angular momentum of a system",
        "analysis.momenta.moment_balance analysis.momenta.centre_of_mass",
        "a always; b if C is at rest or moves parallel to G; c if C is G, has no acceleration, or "
        "one along CG.",
    ),
    20: problem(
        "Two masses, a spring and a step force",
        "scenes.two_masses scenes.springs.two_masses_exact analysis.momenta.centre_of_mass",
        "F = m a_G for any k; both masses stay within O(F / k) of the motion of a rigid rod.",
    ),
}
