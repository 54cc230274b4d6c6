"""The zoo: ready-made scenes, one file a family."""

from jaxdyn.scenes.nbody import EIGHT as EIGHT
from jaxdyn.scenes.nbody import EIGHT_GUESS as EIGHT_GUESS
from jaxdyn.scenes.nbody import EIGHT_GUESS_PERIOD as EIGHT_GUESS_PERIOD
from jaxdyn.scenes.nbody import EIGHT_PERIOD as EIGHT_PERIOD
from jaxdyn.scenes.nbody import three_body as three_body
from jaxdyn.scenes.particles import cannonball as cannonball
