"""The pages of the API reference: what the docstrings say, and which notebooks use what."""

import importlib
import inspect
import pkgutil
import re
from importlib.util import find_spec

from trackhelpers.suite.ledger_page import titles

__all__ = ["GROUPS", "api_pages", "homes", "users"]

GROUPS = {  # page -> title, modules and packages
    "api_models": ("Models of motion", ("model", "motion", "charts", "angles")),
    "api_sensors": ("Sensors and fixes", ("sensors", "fixes", "batch")),
    "api_filters": ("Filters of one target", ("filters", "follow", "smoothing", "manoeuvre")),
    "api_ensemble": ("Ensembles", ("ensemble",)),
    "api_judging": ("Judging and fusing", ("consistency", "exact", "fusion", "intervals")),
    "api_suite": (
        "Data, tables, figures, ledger",
        ("datasets", "recordings", "reports", "published", "tables", "numerals", "plots", "play", "ledger"),
    ),
}


def modules_of(names):
    """The modules behind names of modules and packages of trackhelpers, dotted, in the order of the names; those that do not exist are left out."""
    found = []
    for name in names:
        full = f"trackhelpers.{name}"
        if find_spec(full) is None:
            continue
        package = importlib.import_module(full)
        found.append(full)
        if hasattr(package, "__path__"):
            found += [f"{full}.{each.name}" for each in pkgutil.iter_modules(package.__path__)]
    return found


def homes():
    """Return where the reference describes a public class or function: name -> (page, full dotted name)."""
    found = {}
    for page, (_, names) in GROUPS.items():
        for module in map(importlib.import_module, modules_of(names)):
            for name, value in vars(module).items():
                if (
                    not name.startswith("_")
                    and (inspect.isclass(value) or inspect.isfunction(value))
                    and value.__module__ == module.__name__
                ):
                    found.setdefault(name, (page, f"{module.__name__}.{name}"))
    return found


def users(notebooks):
    """Return which notebooks import a name of trackhelpers: name -> names of notebooks, in reading order; `notebooks` maps a name to a notebook."""
    found = {}
    for notebook, content in notebooks.items():
        code = "\n".join(cell.source for cell in content.cells if cell.cell_type == "code")
        for names in re.findall(r"from trackhelpers[\w.]* import (?:\(([^)]*)\)|([^\n]*))", code):
            for name in re.findall(r"\w+", "".join(names)):
                if notebook not in found.setdefault(name, []):
                    found[name].append(notebook)
    return found


def api_pages(notebooks):
    """Return the pages, name of the file -> MyST, for the book's notebooks as `users` takes them."""
    used, known, called = users(notebooks), homes(), titles(notebooks)
    pages = {}
    for page, (title, names) in GROUPS.items():
        parts = [f"# {title}"]
        for module in modules_of(names):
            parts += [f"## {module.removeprefix('trackhelpers.')}", f"```{{eval-rst}}\n.. automodule:: {module}\n   :members:\n```"]
            here = [name for name, (_, full) in known.items() if full.rpartition(".")[0] == module and name in used]
            if here:
                lines = [f"* `{name}`: " + "; ".join(f"[{called[n]}]({n}.ipynb)" for n in used[name][:4]) for name in here]
                parts += ["In the notebooks:", "\n".join(lines)]
        pages[f"{page}.md"] = "\n\n".join(parts) + "\n"
    return pages
