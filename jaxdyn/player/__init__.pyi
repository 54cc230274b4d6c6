"""The names of jaxdyn.player: for type checkers, and for imports when they are first used."""

from .choices import Ask as Ask
from .live_pages import live as live
from .motion_data import export as export
from .pages import PlayerPage as PlayerPage
from .pages import embed as embed
from .pages import fragment as fragment
from .pages import look as look
from .pages import play as play
from .pages import script as script
