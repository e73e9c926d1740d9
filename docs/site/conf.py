"""Sphinx: the documents as one site with a search, from a staged copy of the tree."""

project = "Fretwear"
copyright = "the authors of Fretwear"

extensions = ["myst_parser"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]
# Anchors as the documents use them, those of headings.
myst_heading_anchors = 4
# Listings of cases and programs have no lexer of their own.
highlight_language = "none"

html_theme = "alabaster"
html_theme_options = {"description": "Vibration with contact, friction and fretting wear",
                      "page_width": "1180px", "sidebar_width": "260px", "fixed_sidebar": True}
# A search and a menu of our own: excerpts without a server, and room on a narrow screen.
templates_path = ["templates"]
html_static_path = ["static"]
html_css_files = ["site.css"]
html_sidebars = {"**": ["about.html", "searchbox.html", "menu.html", "localtoc.html"]}
html_copy_source = False
