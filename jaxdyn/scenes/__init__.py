"""Ready-made scenes, one file a family; `jaxdyn list` shows them with their parameters.

`disks` has a disk that rolls, `cylinders` the scenes, events and phases of cylinders that roll,
slip and fly, `walkers` mechanisms that walk down a slope, `impacts` driven bodies that hit
something, `corners` the phases of all scenes whose motions have corners, `sections` two systems
known for their surfaces of section, `restricted` bodies of no mass in turning axes. `catalogue`
lists all scenes, `ready_made` has what their functions share, and `switching` exchanges coordinates
that become singular during a motion.

May import: `mechanisms`, `effects`, `integrate`.

To add a scene, write a function ``name(mass=1.0, ...)`` in the file of its family that returns a
`Scene` and is decorated with `ready_made()`; give the unit of each parameter in its docstring,
where `jaxdyn/cli/docstrings.py` reads it; add a line below; and, if the scene answers a problem of
the course, use it on a page of `jaxdyn/course`.
"""

from jaxdyn.scenes import ballistics, catalogue, satellites, switching
from jaxdyn.scenes.apsidal import apsidal_angle, apsidal_limits, apsides
from jaxdyn.scenes.bodies import box, feynman_plate, free_body, satellite, top
from jaxdyn.scenes.central import (
    central_orbit,
    circular_speed,
    fewest_loops,
    power_law,
    swept_angle,
)
from jaxdyn.scenes.corners import phases_of
from jaxdyn.scenes.cylinders import (
    contact_lost,
    cylinder_on_cylinder,
    cylinder_on_ramp,
    friction_needed,
)
from jaxdyn.scenes.disks import rolling_disk
from jaxdyn.scenes.drawings import moved_box, moved_shape, turned_box
from jaxdyn.scenes.guides import (
    bead_on_cycloid,
    bead_on_parabola,
    plate,
    plate_turn,
    turntable,
    turntable_limit,
)
from jaxdyn.scenes.impacts import ball_on_table, impact_oscillator
from jaxdyn.scenes.linkages import dumbbell, four_bar, pinned_chain, rod_on_line, skate_chain
from jaxdyn.scenes.lorenz_system import lorenz
from jaxdyn.scenes.nbody import (
    EIGHT,
    EIGHT_GUESS,
    EIGHT_GUESS_PERIOD,
    EIGHT_PERIOD,
    n_body,
    three_body,
    three_body_circular,
    two_body,
)
from jaxdyn.scenes.particles import cannonball, particle, polar_particle, straightness
from jaxdyn.scenes.pendula import (
    cart_pendulum,
    double_pendulum,
    n_pendulum,
    pendulum,
    shaken_pendulum,
    triple_pendulum,
)
from jaxdyn.scenes.restricted import (
    hill,
    jacobi_constant,
    libration_point,
    restricted_three_body_in_space,
)
from jaxdyn.scenes.sections import henon_heiles, libration_points, restricted_three_body
from jaxdyn.scenes.sideways import sideways_edge, sideways_pendulum
from jaxdyn.scenes.skates import one_skate, two_skates
from jaxdyn.scenes.springs import hanging_spring, oscillator, spring_mass, two_masses, two_springs
from jaxdyn.scenes.walkers import rimless_wheel, simplest_walker
from jaxdyn.scenes.wheels import braking, car, turning_rate

__all__ = [
    "EIGHT",
    "EIGHT_GUESS",
    "EIGHT_GUESS_PERIOD",
    "EIGHT_PERIOD",
    "apsidal_angle",
    "apsidal_limits",
    "apsides",
    "ball_on_table",
    "ballistics",
    "bead_on_cycloid",
    "bead_on_parabola",
    "box",
    "braking",
    "cannonball",
    "car",
    "cart_pendulum",
    "catalogue",
    "central_orbit",
    "circular_speed",
    "contact_lost",
    "cylinder_on_cylinder",
    "cylinder_on_ramp",
    "double_pendulum",
    "dumbbell",
    "fewest_loops",
    "feynman_plate",
    "four_bar",
    "free_body",
    "friction_needed",
    "hanging_spring",
    "henon_heiles",
    "hill",
    "impact_oscillator",
    "jacobi_constant",
    "libration_point",
    "libration_points",
    "lorenz",
    "moved_box",
    "moved_shape",
    "n_body",
    "n_pendulum",
    "one_skate",
    "oscillator",
    "particle",
    "pendulum",
    "phases_of",
    "pinned_chain",
    "plate",
    "plate_turn",
    "polar_particle",
    "power_law",
    "restricted_three_body",
    "restricted_three_body_in_space",
    "rimless_wheel",
    "rod_on_line",
    "rolling_disk",
    "satellite",
    "satellites",
    "shaken_pendulum",
    "sideways_edge",
    "sideways_pendulum",
    "simplest_walker",
    "skate_chain",
    "spring_mass",
    "straightness",
    "swept_angle",
    "switching",
    "three_body",
    "three_body_circular",
    "top",
    "triple_pendulum",
    "turned_box",
    "turning_rate",
    "turntable",
    "turntable_limit",
    "two_body",
    "two_masses",
    "two_skates",
    "two_springs",
]
