"""What a project is joined by: lowest versions, recipe, article, forms and hooks agree with the package."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from typing import Any

import yaml
from bibtexparser.entrypoint import parse_string
from doc_commands import PAGES, ROOT
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

import annelid
from annelid.cli.entry import OLD_COMMANDS
from annelid.config.checking import RENAMED
from fill_tables import filled

PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
RUNTIME = [Requirement(line) for line in PROJECT["project"]["dependencies"]]
FORMS = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"))
NOT_TRIED = {"sns", "bench", "learn", "dev"}
"""Extras whose lowest versions CONTRIBUTING says nobody has tried."""
CONDA = {
    "mujoco-core": {"mujoco-python"},
    "imageio": {"imageio", "imageio-ffmpeg", "psutil"},
    "matplotlib": {"matplotlib-base"},
}
"""Names on conda-forge, where they are others or more."""
PARTS = {"imageio-ffmpeg", "pydantic-core", "hdmf", "trimesh", "websockets"}
"""What a stated package is made of: imageio, pydantic, pynwb and viser bring them, and their versions go together."""


def lowest(requirement: Requirement) -> Version:
    (bound,) = requirement.specifier
    assert bound.operator == ">=", requirement
    return Version(bound.version)


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def test_lowest_versions_are_those_that_were_tried() -> None:
    lines = [line for line in read("constraints-floors.txt").splitlines() if not line.startswith("#")]
    tried = {name: Version(version) for name, version in (line.split("==") for line in lines)}
    extras = PROJECT["project"]["optional-dependencies"]
    stated = RUNTIME + [Requirement(line) for extra in extras.keys() - NOT_TRIED for line in extras[extra]]
    bounds = {canonicalize_name(each.name): lowest(each) for each in stated if each.name != "annelid"}
    assert {name: tried.get(name) for name in bounds} == bounds


def test_every_package_that_is_imported_is_stated() -> None:
    nodes = [node for path in (ROOT / "src").rglob("*.py") for node in ast.walk(ast.parse(path.read_bytes()))]
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    imported = {name.split(".")[0] for name in names} - sys.stdlib_module_names
    homes = packages_distributions()
    needed = {canonicalize_name(home) for name in imported for home in homes.get(name, ())} - PARTS - {"annelid"}
    extras = PROJECT["project"]["optional-dependencies"]
    stated = RUNTIME + [Requirement(line) for lines in extras.values() for line in lines]
    assert needed - {canonicalize_name(each.name) for each in stated} == set()


def test_the_recipe_has_the_packages_dependencies() -> None:
    recipe = read("recipe/meta.yaml")
    found = re.search(r"  run:\n(    - .+\n)+", recipe)
    assert found is not None
    lines = [line.split() for line in re.findall(r"- (.+)", found[0])]
    bounds = {name: next(iter(bound), "").removeprefix(">=") for name, *bound in lines}
    names = {each.name: CONDA.get(each.name, {each.name}) for each in RUNTIME}
    assert bounds.keys() == {"python"}.union(*names.values())
    for each in RUNTIME:
        assert str(lowest(each)) in {bounds[name] for name in names[each.name]}
    assert f'set version = "{annelid.__version__}"' in recipe
    assert f'set python_min = "{PROJECT["project"]["requires-python"].removeprefix(">=")}"' in recipe


def test_the_article_says_what_the_pages_say() -> None:
    article = read("paper/paper.md")
    assert filled(article) == article, "run: python docs/site/fill_tables.py"
    (tally,) = re.findall(r"^Verdicts on the paper's .+$", PAGES["docs/evidence/paper.md"], re.MULTILINE)
    (sentence,) = re.findall(r"Of \d+ claims, [^.]+\.", " ".join(article.split()))
    assert re.findall(r"\d+", sentence) == re.findall(r"\d+", tally)
    header, text = article.split("---\n", 2)[1:]
    assert yaml.safe_load(header)["bibliography"] == "paper.bib"
    words = [word for word in re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL).split() if re.search(r"\w", word)]
    assert 700 <= len(words) <= 1000
    library = parse_string(read("paper/paper.bib"))
    assert library.failed_blocks == []
    assert {entry.key for entry in library.entries} == set(re.findall(r"@(\w+)", text))


def test_the_roadmap_has_the_names_that_go() -> None:
    section = PAGES["docs/roadmap.md"].split("## Names that go")[1].split("\n## ")[0]
    listed = dict(re.findall(r"^\|[A-Za-z ]*\| `([^`]+)` \| `([^`]+)` \|$", section, re.MULTILINE))
    assert listed.pop("annelid.planar") == "annelid_studies.planar"
    assert listed == {name: " ".join(now) for name, now in OLD_COMMANDS.items()} | RENAMED


def test_forms_ask_for_something() -> None:
    for form in FORMS:
        fields = yaml.safe_load(form.read_text(encoding="utf-8"))
        assert fields.keys() >= {"name", "description", "body"}
        asked = [each for each in fields["body"] if each["type"] != "markdown"]
        assert len({each["id"] for each in asked}) == len(asked) > 1, form
        assert all(each["attributes"]["label"] for each in asked), form


def test_hooks_need_nothing_that_is_not_installed_here() -> None:
    repos = yaml.safe_load(read(".pre-commit-config.yaml"))["repos"]
    assert [repo["repo"] for repo in repos] == ["local"]
    assert {hook["language"] for hook in repos[0]["hooks"]} == {"system"}


def test_the_sdist_lists_what_there_is() -> None:
    listed = PROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    assert [name for name in listed if not (ROOT / name).exists()] == []
