"""The site builds without a warning, nothing in it leads nowhere, and what is made from the code is whole."""

from __future__ import annotations

import ast
import re
import subprocess
from pathlib import Path

import pytest
from doc_commands import PAGES, ROOT
from site_pages import broken_links, fetched_from_elsewhere, leading_nowhere, repository_page

import annelid
import build_site
import configuration_reference
import notebooks
import run_file_reference
from annelid.config import field_paths
from navigation import entries, expanded

TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
FAST = ("own_network",)
"""Tutorials that do not take a quarter of a minute; only the slow tests run the others."""


@pytest.mark.parametrize(
    "tutorial",
    [pytest.param(each, id=each.stem, marks=[pytest.mark.slow] * (each.stem not in FAST)) for each in TUTORIALS],
)
def test_a_tutorial_runs_from_top_to_bottom(tutorial: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Whatever was built on this machine before.
    monkeypatch.setenv(notebooks.CACHE_VARIABLE, str(tmp_path))
    shown = notebooks.run(tutorial.read_text(encoding="utf-8"), tutorial.stem)
    assert "```text { .output }" in shown.markdown
    assert "Traceback" not in shown.markdown


def test_the_site_is_whole(site: Path) -> None:
    pages = {path.relative_to(site).with_suffix("").as_posix() for path in site.rglob("*.html")}
    assert {Path(name).relative_to("docs").with_suffix("").as_posix() for name in PAGES if name != "README.md"} <= pages
    assert f"annelid {annelid.__version__}" in (site / "start.html").read_text(encoding="utf-8")
    assert list(broken_links(site)) == []
    assert list(fetched_from_elsewhere(site)) == []


def test_a_broken_link_ends_the_build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def two_pages(target: Path) -> None:
        target.mkdir(parents=True)
        (target / "index.md").write_text("# One\n\n[two](two.md#no-such-heading)\n")
        (target / "two.md").write_text("# Two\n")
        (target / "style.css").touch()

    monkeypatch.setattr(build_site, "gather", two_pages)
    monkeypatch.setattr(build_site, "expanded", lambda nav, pages: ["index.md", "two.md"])
    with pytest.raises(subprocess.CalledProcessError):
        build_site.build(tmp_path)


def test_links_pictures_and_anchors_that_lead_nowhere_are_found(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text(
        '<h1 id="here"></h1><a href="#here"></a><a href="b.html#there"></a><a href="c.html"></a><img src="d.png">'
        '<script src="https://example.org/e.js"></script>'
    )
    (tmp_path / "b.html").write_text('<a href="a.html#here"></a>')
    assert list(broken_links(tmp_path)) == ["a.html: b.html#there", "a.html: c.html", "a.html: d.png"]
    assert list(fetched_from_elsewhere(tmp_path)) == ["a.html: https://example.org/e.js"]
    page = tmp_path / "page.md"
    page.write_text("# A `b`, c\n\n# A b c\n\n[1](#a-b-c) [2](#a-b-c-1) [3](#a-b-c-2) [4](a.html) [5](b.md)\n")
    found = leading_nowhere({page: repository_page(page)}, tmp_path, Path.exists)
    assert list(found) == ["page.md: #a-b-c-2", "page.md: b.md"]


def test_a_pattern_stands_for_the_pages_that_nothing_else_names() -> None:
    nav = ["index.md", {"Guides": ["z.md", "*.md", "how/*.md"]}, {"Named": {"x": 1} and "y.md"}]
    pages = ["index.md", "a.md", "y.md", "z.md", "how/b.md", "how/deep/c.md"]
    assert expanded(nav, pages) == ["index.md", {"Guides": ["z.md", "a.md", "how/b.md"]}, {"Named": "y.md"}]
    assert list(entries(nav)) == ["index.md", "z.md", "*.md", "how/*.md", "y.md"]


def test_the_reference_has_every_field_of_the_configuration() -> None:
    page = configuration_reference.page()
    for path in field_paths():
        section, _, leaf = path.rpartition(".")
        headings = [
            part for part in re.split(r"\n##+ ", page) if re.match(rf"{re.escape(section) or 'The run'}[: \n]", part)
        ]
        assert any(f"| `{leaf}` |" in part for part in headings), path


def test_the_reference_has_every_variable_of_a_run(tmp_path: Path) -> None:
    config = annelid.load_config("riddle2025-3x1", {"turning.kind": "constant", "duration_s": 0.02})
    data = annelid.simulate(config, tmp_path, progress=False).data
    page = PAGES["docs/reference/run_file.md"] + run_file_reference.page()
    assert [name for name in data.data_vars if f"`{name}`" not in page] == []
    of_bodies = re.findall(r"^\| `(\w+)` \|", page.split("## Recorded by the body")[1].split("\n## ")[0], re.MULTILINE)
    assert "pin_gap" in of_bodies


def test_the_reference_has_every_public_name() -> None:
    page = PAGES["docs/reference/api/index.md"]
    shown = set(re.findall(r"^::: annelid[.\w]*\.(\w+)$", page, re.MULTILINE))
    assert set(annelid.__all__) - {"__version__"} <= shown


def texts_of_the_source() -> set[str]:
    """All texts in the source, with … in place of what is filled in."""
    texts = set()
    for path in sorted((ROOT / "src").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                parts = (str(part.value) if isinstance(part, ast.Constant) else "…" for part in node.values)
                texts.add(re.sub("…+", "…", "".join(parts)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.add(node.value)
    return texts


def test_every_message_of_the_troubleshooting_is_one_of_the_source() -> None:
    headings = re.findall(r"^### (.*)$", PAGES["docs/troubleshooting.md"], re.MULTILINE)
    quoted = [message for heading in headings for message in re.findall(r"`([^`]+)`", heading)]
    texts = texts_of_the_source()
    assert len(quoted) > 30

    def said(message: str) -> bool:
        pattern = ".*".join(re.escape(part) for part in message.split("…"))
        return any(re.search(pattern, text, re.DOTALL) for text in texts)

    # `unknown preset …` is one text for presets and arenas, whose kind is filled in.
    missing = [message for message in quoted if not said(re.sub("^unknown (preset|arena)", "unknown …", message))]
    assert missing == []
    assert not said("the worm is tired of …")


def test_links_lead_to_what_the_repository_has() -> None:
    git = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    tracked = {ROOT / name for name in git.stdout.splitlines()}
    tracked |= {folder for path in tracked for folder in path.parents}
    # A copy without its history has only what was tracked.
    there = tracked.__contains__ if tracked else Path.exists
    patterns = ("*.md", ".github/**/*.md", "[!.]*/**/*.md", "[!.]*/**/*.ipynb")
    pages = {path: repository_page(path) for pattern in patterns for path in ROOT.glob(pattern) if there(path)}
    assert len(pages) > len(PAGES)
    # Names are anchors of the reference for Python only once it is built; test_the_site_is_whole follows these.
    broken = leading_nowhere(pages, ROOT, there)
    assert [link for link in broken if not re.search(r"reference/api/\w+\.md#annelid\.", link)] == []
