"""Motions in a browser: pages that play them, and pages on which a scene itself runs.

`motion_data` writes the paths from `drawing.paths`, and the energy along the motion, as compact
JSON; `pages` puts it into a page with the script `player.js` and the style sheet `player.css`,
which needs no other files and no network. `model` writes a scene as a program in JavaScript, with
its rate, its drawing, and the initial states and questions of `choices`; `live_pages` puts that
into a page with the scripts `live.js` and `motion.js`, which uses the integrator `dop853.js`. Both
kinds of pages draw with `canvas.js`.

May import: `drawing`, `symbolic`.

To add a kind of shape, add a case to ``stroke`` in `canvas.js`. Pages, notebooks and the gallery
use the same files.
"""

import lazy_loader

import jaxdyn._doors

_listed, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

#: Renamed in version 0.3.
_RENAMED = {"Playing": "PlayerPage"}
__getattr__ = jaxdyn._doors.attribute_getter(__name__, _listed, renamed=_RENAMED)
