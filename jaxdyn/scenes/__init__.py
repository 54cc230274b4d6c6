"""The zoo: ready-made scenes, one file a family; `jaxdyn list` shows them with their numbers.

`catalogue` is the list of them, `switching` exchanges coordinates that fail on the way. May
import: `mechanisms`, `effects`, `integrate`.

One more scene is a function ``name(mass=1.0, ...)`` in the file of its family that returns a
`Scene`, one line below, and an entry of `catalogue` with the unit of each number.
"""

from jaxdyn.scenes import ballistics as ballistics
from jaxdyn.scenes import catalogue as catalogue
from jaxdyn.scenes import satellites as satellites
from jaxdyn.scenes import switching as switching
from jaxdyn.scenes.apsidal import apsidal_angle as apsidal_angle
from jaxdyn.scenes.apsidal import apsidal_limits as apsidal_limits
from jaxdyn.scenes.apsidal import apsides as apsides
from jaxdyn.scenes.bodies import box as box
from jaxdyn.scenes.bodies import feynman_plate as feynman_plate
from jaxdyn.scenes.bodies import free_body as free_body
from jaxdyn.scenes.bodies import satellite as satellite
from jaxdyn.scenes.bodies import top as top
from jaxdyn.scenes.central import central_orbit as central_orbit
from jaxdyn.scenes.central import circular_speed as circular_speed
from jaxdyn.scenes.central import fewest_loops as fewest_loops
from jaxdyn.scenes.central import power_law as power_law
from jaxdyn.scenes.central import swept_angle as swept_angle
from jaxdyn.scenes.disks import rolling_disk as rolling_disk
from jaxdyn.scenes.drawings import moved_box as moved_box
from jaxdyn.scenes.drawings import moved_shape as moved_shape
from jaxdyn.scenes.drawings import turned_box as turned_box
from jaxdyn.scenes.guides import bead_on_cycloid as bead_on_cycloid
from jaxdyn.scenes.guides import bead_on_parabola as bead_on_parabola
from jaxdyn.scenes.guides import plate as plate
from jaxdyn.scenes.guides import plate_turn as plate_turn
from jaxdyn.scenes.guides import turntable as turntable
from jaxdyn.scenes.guides import turntable_limit as turntable_limit
from jaxdyn.scenes.linkages import dumbbell as dumbbell
from jaxdyn.scenes.linkages import four_bar as four_bar
from jaxdyn.scenes.linkages import pinned_chain as pinned_chain
from jaxdyn.scenes.linkages import rod_on_line as rod_on_line
from jaxdyn.scenes.linkages import skate_chain as skate_chain
from jaxdyn.scenes.nbody import EIGHT as EIGHT
from jaxdyn.scenes.nbody import EIGHT_GUESS as EIGHT_GUESS
from jaxdyn.scenes.nbody import EIGHT_GUESS_PERIOD as EIGHT_GUESS_PERIOD
from jaxdyn.scenes.nbody import EIGHT_PERIOD as EIGHT_PERIOD
from jaxdyn.scenes.nbody import three_body as three_body
from jaxdyn.scenes.nbody import three_body_circular as three_body_circular
from jaxdyn.scenes.nbody import two_body as two_body
from jaxdyn.scenes.particles import cannonball as cannonball
from jaxdyn.scenes.particles import lorenz as lorenz
from jaxdyn.scenes.particles import particle as particle
from jaxdyn.scenes.particles import polar_particle as polar_particle
from jaxdyn.scenes.particles import straightness as straightness
from jaxdyn.scenes.pendula import cart_pendulum as cart_pendulum
from jaxdyn.scenes.pendula import double_pendulum as double_pendulum
from jaxdyn.scenes.pendula import n_pendulum as n_pendulum
from jaxdyn.scenes.pendula import pendulum as pendulum
from jaxdyn.scenes.pendula import shaken_pendulum as shaken_pendulum
from jaxdyn.scenes.pendula import triple_pendulum as triple_pendulum
from jaxdyn.scenes.rolling import contact_lost as contact_lost
from jaxdyn.scenes.rolling import cylinder_on_cylinder as cylinder_on_cylinder
from jaxdyn.scenes.rolling import cylinder_on_ramp as cylinder_on_ramp
from jaxdyn.scenes.rolling import friction_needed as friction_needed
from jaxdyn.scenes.rolling import phases_of as phases_of
from jaxdyn.scenes.sideways import sideways_edge as sideways_edge
from jaxdyn.scenes.sideways import sideways_pendulum as sideways_pendulum
from jaxdyn.scenes.skates import one_skate as one_skate
from jaxdyn.scenes.skates import two_skates as two_skates
from jaxdyn.scenes.springs import hanging_spring as hanging_spring
from jaxdyn.scenes.springs import oscillator as oscillator
from jaxdyn.scenes.springs import spring_mass as spring_mass
from jaxdyn.scenes.springs import two_masses as two_masses
from jaxdyn.scenes.springs import two_springs as two_springs
from jaxdyn.scenes.wheels import braking as braking
from jaxdyn.scenes.wheels import car as car
