"""The zoo: ready-made scenes, one file a family."""

from jaxdyn.scenes.nbody import three_body as three_body
from jaxdyn.scenes.particles import cannonball as cannonball
