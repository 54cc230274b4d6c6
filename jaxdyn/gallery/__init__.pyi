"""The public names of the gallery: for type checkers, and for imports when they are first used."""

from .site import BuiltSite as BuiltSite
from .site import build as build
