"""The public names of the gallery: for type checkers, and for imports when they are first used."""

from .site import Built as Built
from .site import build as build
