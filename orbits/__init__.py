"""orbits: periodic orbits of jaxdyn's scenes, found, identified, tested for stability, checked.

An example, from a textbook's rough guess to Montgomery's figure-eight:

>>> import jaxdyn
>>> import orbits
>>> from jaxdyn import scenes
>>> jaxdyn.configure()
>>> scene = scenes.three_body()
>>> plain = orbits.find(scene, scenes.EIGHT_GUESS, scenes.EIGHT_GUESS_PERIOD)
>>> orbits.identify(plain).choreography        # it closes, but is not the eight
False
>>> orbits.stability(plain).verdict
'unstable'
>>> eight = orbits.find(scene, plain.y0, plain.period, closing=orbits.choreography(3))
>>> orbits.identify(eight).choreography, orbits.stability(eight).verdict
(True, 'stable')
>>> round(orbits.normal_form(eight).period, 9)
6.325913983
"""

import lazy_loader

from jaxdyn import __version__ as __version__
from jaxdyn._doors import attribute_getter
from jaxdyn.files import loading

_listed, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
#: The folders to which names of this package moved in version 0.3.
_MOVED = {
    "Certificate": "proof",
    "Closing": "closing",
    "Condition": "closing",
    "Connection": "manifolds",
    "ConnectionOutcome": "manifolds",
    "Criticality": "families",
    "Diagram": "families",
    "DifferentiableOrbit": "analysis",
    "Family": "families",
    "Graph": "families",
    "Identity": "analysis",
    "Manifold": "manifolds",
    "Match": "analysis",
    "Refined": "proof",
    "Report": "analysis",
    "Reversal": "closing",
    "SearchResult": "discovery",
    "SectionPoints": "sections",
    "Starts": "discovery",
    "Torus": "tori",
    "TorusFamily": "tori",
    "TorusOutcome": "tori",
    "as_json": "analysis",
    "closure": "analysis",
    "match": "analysis",
    "syzygies": "analysis",
    "word": "analysis",
}
__getattr__ = attribute_getter(__name__, _listed, moved=_MOVED, folders=("shooting",))
loading.register(
    {
        "jaxdyn-orbit": "orbits:load",
        "jaxdyn-chain": "orbits:load",
        "jaxdyn-family": "orbits.files.family_files:load",
        "jaxdyn-search": "orbits.discovery.journal:read",
        "jaxdyn-continuation of orbits": "orbits.families:load",
        "jaxdyn-continuation of curve of orbits": "orbits.curves:load",
    }
)
