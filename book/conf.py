"""Sphinx settings of the web book. `make book` lays the executed notebooks and the table of contents before it."""

project = "Tracking manoeuvring targets"
author = "The trackhelpers authors"
language = "en"
root_doc = "00_start_here"
exclude_patterns = ["_build", "jupyter_execute", "**.ipynb_checkpoints"]

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx-mathjax-offline"]
myst_enable_extensions = ["amsmath", "dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "off"  # they were run before
nb_ipywidgets_js = {}  # the scripts of live widgets would come from the network
nb_merge_streams = True
nb_output_stderr = "error"
nb_render_markdown_format = "myst"  # captions and ledgers link to pages and hold formulas

autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_use_type_comments = False  # there are none, and to look for them takes a second
default_role = "code"  # in docstrings
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
suppress_warnings = ["ref.python"]  # a letter such as S is an attribute of more than one class

html_theme = "sphinx_book_theme"
html_title = project
html_theme_options = {"home_page_in_toc": True, "navigation_with_keys": False, "navbar_persistent": [], "show_toc_level": 2}
html_context = {"default_mode": "auto"}  # without it the theme complains in the console at a first visit
html_show_copyright = False
html_show_sphinx = False
html_static_path = ["_static"]
html_css_files = ["wide.css"]
nb_code_prompt_show = "Show the solution"  # what is folded is always one
nb_code_prompt_hide = "Hide the solution"
