"""Pages that everybody can read and use, as far as axe-core can say: site, report and live view."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import pytest
from live_page import CHROMIUM, open_show

from annelid.config import load_config
from annelid.draw import html_page

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here to open pages with")

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    page = browser.new_page(viewport={"width": 400, "height": 900}, color_scheme="dark")
    yield page
    page.close()


def serious(page: Page) -> list[str]:
    """What axe-core finds serious or critical on a page: each rule with the first place that breaks it."""
    page.evaluate((resources.files("axe_playwright_python") / "axe.min.js").read_text(encoding="utf-8"))
    found = page.evaluate("axe.run()")["violations"]
    return [
        f"{one['id']}: {one['nodes'][0]['html']} {one['nodes'][0]['failureSummary']}"
        for one in found
        if one["impact"] in ("serious", "critical")
    ]


def too_wide(page: Page) -> list[str]:
    """Says where a page is wider than its window."""
    wide, window = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
    return [f"{wide} px wide in a window of {window} px"] if wide > window else []


def test_the_site(page: Page, site: Path) -> None:
    page.goto((site / "evidence/gait.html").as_uri())
    page.wait_for_timeout(300)
    assert serious(page) == []
    assert too_wide(page) == []


def test_a_report(page: Page, tmp_path: Path) -> None:
    claims = "| # | Claim | Verdict |\n| --- | --- | --- |\n| 1 | It walks. | **holds** |\n\n1. Seen: `annelid run`"
    content = f"## Numbers\n\n| a | b |\n| --- | --- |\n| 1 | 2 |\n\n### Claims\n\n{claims}"
    contents = "- [Numbers](#numbers)\n  - [Claims](#claims)"
    (tmp_path / "report.html").write_text(html_page("Report", "# Report", contents, content, tmp_path))
    page.goto((tmp_path / "report.html").as_uri())
    assert serious(page) == []
    assert not page.get_by_text("It walks.").is_visible()
    page.evaluate("location.hash = 'claims'")
    page.get_by_text("It walks.").wait_for()
    assert serious(page) == []


def test_the_live_view(page: Page) -> None:
    with open_show(load_config("riddle2023-rods")) as show:
        page.goto(show.address)
        page.wait_for_selector("text=Nervous system", state="attached", timeout=60_000)
        page.locator("[role=slider][aria-label=friction]").wait_for()
        page.wait_for_timeout(1000)
        assert serious(page) == []
        page.get_by_role("button", name="Keys").click()
        assert serious(page) == []


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 400])
def test_every_page_of_the_site(browser: Browser, site: Path, width: int, scheme: Literal["light", "dark"]) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    wrong = []
    for path in sorted(site.rglob("*.html")):
        page.goto(path.as_uri())
        page.wait_for_timeout(200)
        wrong += [f"{path.relative_to(site)}: {one}" for one in serious(page) + too_wide(page)]
    page.close()
    assert wrong == []
