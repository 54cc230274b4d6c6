"""Motions in a browser: pages that play them, and pages on which a scene itself runs.

`export` writes what `drawing.paths` finds, and the energy along the motion, as compact JSON;
`pages` puts it into a page with the script `player.js` and its look `player.css`, which need no
other files and no network. `model` writes a scene as a program in JavaScript, its rate and what is
drawn of it, with the starts and questions of `choices`; `live` puts that into a page with the
scripts `motion.js`, which moves it by the integrator `dop853.js`, and `live.js`. Both draw by
`canvas.js`.

May import: `drawing`, `symbolic`.

One more kind of shape is one more case of ``stroke`` in `canvas.js`; the files beside this one are
the same for pages, notebooks and the gallery.
"""

from jaxdyn.player.choices import Ask
from jaxdyn.player.export import export
from jaxdyn.player.live import live
from jaxdyn.player.pages import Playing, embed, fragment, look, play, script

__all__ = ["Ask", "Playing", "embed", "export", "fragment", "live", "look", "play", "script"]
