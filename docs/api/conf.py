"""Sphinx: reference of the Python package from its sources, without the compiled part."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "python"))

from fretwear import __version__  # noqa: E402

project = "Fretwear"
copyright = "the authors of Fretwear"
version = release = __version__

extensions = ["sphinx.ext.autodoc", "numpydoc"]
exclude_patterns = ["*.md"]
# Types are in the signatures; the docstrings say shapes and units.
autodoc_typehints = "signature"
autodoc_type_aliases = {name: name for name in (
    "ArrayLike", "Complexes", "Floats", "Matrix", "ModelLike", "Progress")}
autodoc_member_order = "bysource"
autodoc_mock_imports = ["fretwear._core", "distributed", "meshio", "pyyeti", "ansys", "skfem"]
autodoc_default_options = {"members": True, "show-inheritance": True}
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

html_theme = "alabaster"
html_theme_options = {"description": "Vibration with contact, friction and fretting wear",
                      "page_width": "1100px", "sidebar_width": "240px"}
html_sidebars = {"**": ["about.html", "localtoc.html", "navigation.html"]}
html_copy_source = False
