"""Motions in a browser: what is drawn of them, exported, and a page that plays it.

`export` writes what `drawing.paths` finds, and the energy along the motion, as compact JSON;
`pages` puts it into a page with the script `player.js` and its look `player.css`, which need no
other files and no network.

May import: `drawing`.

One more kind of shape is one more case of ``shape`` in `player.js`; the files beside this one are
the same for pages, notebooks and the gallery.
"""

from jaxdyn.player.export import export
from jaxdyn.player.pages import Playing, embedded, fragment, look, play, script

__all__ = ["Playing", "embedded", "export", "fragment", "look", "play", "script"]
