"""Problems 40 to 61: rotations, and rigid bodies in space."""

from jaxdyn.course.problems.problem import Problem, problem

#: By number.
SPACE: dict[int, Problem] = {
    40: problem(
        "Practice with dyadics",
        "geometry.frames.tensor_in_world geometry.frames.tensor_in_body "
        "geometry.frames.matrix_between geometry.frames.orthonormalise",
        "Reading; tensors and their components in two bases.",
    ),
    41: problem(
        "Index notation",
        "geometry.indices.check_indices geometry.indices.evaluate_indices "
        "geometry.indices.kronecker geometry.indices.levi_civita",
        "The value of each expression, or the reason why it is invalid. In the text read b_j for "
        "the last b_3, and b_j e_j for b_i e_j.",
    ),
    42: problem(
        "Rotations: one vector, one tensor, two bases",
        "geometry.frames.matrix_between geometry.rotations.rotate "
        "geometry.frames.tensor_in_body geometry.frames.tensor_in_world "
        "geometry.indices.evaluate_indices",
        "r*_B = r whatever R is, R_B = R, and A = R in j.",
    ),
    43: problem(
        "Triple pendulum, four-bar linkage and more",
        "scenes.triple_pendulum scenes.n_pendulum scenes.four_bar scenes.pinned_chain "
        "scenes.skate_chain",
        "Three formulations and closed loops agree; links that cannot close are refused.",
    ),
    44: problem(
        "Euler's theorem on rotations",
        "geometry.rotations.axis_angle_from_matrix",
        "A proof to read; every rotation matrix has an axis and an angle.",
    ),
    45: problem(
        "Two quarter turns",
        "geometry.rotations.rotate geometry.rotations.compose_axis_angle "
        "geometry.rotations.axis_angle_from_matrix",
        "120 degrees about (1, 1, 1): x to y, y to z, z to x.",
    ),
    46: problem(
        "vecrot, rotmat, and back",
        "geometry.rotations.rotate geometry.rotations.matrix_from_axis_angle "
        "geometry.rotations.axis_angle_from_matrix",
        "Axis and angle are recovered to rounding, also at 0 and at pi.",
    ),
    47: problem(
        "A box turned about a line",
        "scenes.turned_box scenes.box formulations.prescribed.Prescribed drawing.animate",
        "120 degrees about (1, 1, 1) permutes the axes.",
    ),
    48: problem(
        "Euler angles",
        "geometry.euler.matrix_from_euler geometry.euler.euler_from_matrix",
        'Fixed "xyz" and body "ZYX" are one rotation, R_z R_y R_x.',
    ),
    49: problem(
        "A box animated by Euler angles",
        "scenes.moved_box formulations.prescribed.Prescribed drawing.animate",
        "Three oscillating angles, or any functions of time; with two of them zero, roll, pitch or "
        "yaw alone.",
    ),
    50: problem(
        "Angular momentum balance about G",
        "analysis.momenta.moment_balance analysis.momenta.centre_of_mass",
        "True about G for any acceleration of G.",
    ),
    51: problem(
        "Euler equations in full",
        "scenes.box scenes.free_body geometry.inertia.equivalent_box geometry.inertia.is_flat",
        "Moments 1, 2, 3 are those of a flat plate, not of a thick box. It flips.",
    ),
    52: problem(
        "Euler equations in the body's axes",
        "scenes.free_body formulations.rigid.pose analysis.energy.along drawing.time_series",
        "Spin about the middle axis is unstable, about the others stable.",
    ),
    53: problem(
        "Rigid bodies by matrix, quaternion and Euler angles",
        "scenes.free_body scenes.box scenes.feynman_plate formulations.rigid.pose",
        "All representations agree. In the text a dot is missing over omega and one over R.",
    ),
    54: problem(
        "Static and dynamic balance",
        "geometry.balance.bearing_forces geometry.inertia.principal geometry.inertia.point",
        "Three axes, in both directions, for an asymmetric body; the plus sign is balanced; one "
        "bearing can carry the whole force.",
    ),
    55: problem(
        "Three satellites",
        "scenes.satellite scenes.satellites.satellite_a scenes.satellites.satellite_b "
        "scenes.satellites.satellite_c scenes.satellites.antenna_trace geometry.inertia.principal",
        "No two moments of A are equal (0.527, 0.795, 1.051): 55 iii is wrong, 57 A i is right.",
    ),
    56: problem(
        "Feynman's plate",
        "scenes.feynman_plate analysis.precession.wobble_and_spin "
        "analysis.precession.free_precession",
        "Two wobbles for one spin: the book has the ratio inverted.",
    ),
    57: problem(
        "Claims about the satellites",
        "course.satellite_claims.satellite_claims scenes.satellite geometry.inertia.principal "
        "analysis.precession.free_attitude analysis.energy.angular_momentum",
        "A ii is false (for the smallest moment), and so is A iii: between the wobbles there are "
        "motions that flip just once. B i to iii and C i, ii are true.",
    ),
    58: problem(
        "Steady precession of axisymmetric bodies in space",
        "analysis.precession.free_attitude analysis.precession.free_precession scenes.satellite "
        "scenes.satellites.antenna_trace",
        "Yes: every free motion is one, exp(t H / I_1) R_0 exp(t omega_s e_3).",
    ),
    59: problem(
        "Steady precession of a top",
        "analysis.precession.top_roots analysis.precession.precession_residual "
        "course.sleeping_top.critical_spin course.sleeping_top.slowest_relative_spin scenes.top "
        "analysis.precession.tilts analysis.steady.linearize_steady",
        "A quadratic equation in omega_p; the slowest total spin upright is 2 sqrt(I m g d) / I_3, "
        "and the slowest relative spin is different. Tops also nutate.",
    ),
    60: problem(
        "Steady precession of a disk on a plane",
        "analysis.precession.rolling_disk_circle analysis.precession.sliding_disk_roots "
        "analysis.precession.frictionless_rolling_disk analysis.precession.disk_residuals "
        "scenes.rolling_disk analysis.steady.linearize_steady",
        "Without slip, without friction, and without both: omega_p^2 = m g r / (I sin(theta)), "
        "omega_3 = 0. The course calls the lean both theta and phi. A uniform disk rolls upright "
        "stably where v^2 > g r / 3.",
    ),
    61: problem(
        "Spinning top in space",
        "scenes.top analysis.precession.top_roots course.sleeping_top.critical_spin "
        "course.sleeping_top.critical_spin_by_linearisation "
        "course.sleeping_top.critical_spin_by_simulation analysis.steady.linearize_steady",
        "Steady starts stay steady; the critical total spin is the limit of stability, found in "
        "three ways.",
    ),
}
