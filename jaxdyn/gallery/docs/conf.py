"""The configuration of Sphinx, which `jaxdyn gallery` runs on the sources that it writes.

Nothing is fetched, neither here nor by the pages: the documentation of other projects is linked if
their inventories are in the folder `inventories` beside this file.
"""

from pathlib import Path

from jaxdyn.gallery import docstrings
from jaxdyn.gallery.reference import PACKAGES

_HERE = Path(__file__).parent
_OTHERS = {
    "python": "https://docs.python.org/3/",
    "numpy": "https://numpy.org/doc/stable/",
    "scipy": "https://docs.scipy.org/doc/scipy/",
    "jax": "https://docs.jax.dev/en/latest/",
}

project = "jaxdyn + orbits"
author = "the jaxdyn maintainers"
project_copyright = f"2026, {author}"
version = release = PACKAGES["jaxdyn"].__version__
extensions = [
    docstrings.__name__,
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.intersphinx",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
]
nitpicky = True
smartquotes_action = "D"  # dashes alone: x'' is a derivative
intersphinx_mapping = {
    name: (url, str(file))
    for name, url in _OTHERS.items()
    if (file := _HERE / "inventories" / f"{name}.inv").exists()
}

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
nb_execution_mode = "off"  # they have run already, see jaxdyn.gallery.tutorials
nb_merge_streams = True
nb_render_markdown_format = "myst"

autodoc_typehints = "none"  # docstrings say shapes and units
autodoc_preserve_defaults = True
autosummary_generate = False
add_module_names = False
python_maximum_signature_line_length = 88
toc_object_entries_show_parents = "hide"
napoleon_numpy_docstring = False
napoleon_custom_sections = docstrings.CUSTOM
napoleon_attr_annotations = False

html_theme = "pydata_sphinx_theme"
html_title = project
_PLAYER = _HERE.parents[1] / "player"
html_static_path = [
    "static",
    *(str(path) for kind in ("*.css", "*.js") for path in _PLAYER.glob(kind)),
    str(_HERE.parent / "minis.js"),
]
html_css_files = ["player.css", "live.css", "site.css"]
html_context = {"default_mode": "auto"}
html_show_sourcelink = False
html_copy_source = False
html_show_search_summary = False  # they are fetched, which pages from a disk may not do
html_math_renderer = "mathml"
html_theme_options = {
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "header_links_before_dropdown": 7,
    "navbar_end": ["theme-switcher"],
    "footer_start": ["copyright"],
    "footer_end": ["sphinx-version"],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
pygments_style = "default"
