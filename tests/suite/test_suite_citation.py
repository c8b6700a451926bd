"""What the citation says agrees with the package, and the changelog knows the version."""

import re
import tomllib

from trackhelpers.suite import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_citation_and_changelog_agree_with_the_package():
    cited = dict(re.findall(r"^(\w+): (.*)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), flags=re.MULTILINE))
    assert (cited["version"], cited["license"], cited["title"]) == (PROJECT["version"], PROJECT["license"], PROJECT["description"])
    assert f"## {PROJECT['version']}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
