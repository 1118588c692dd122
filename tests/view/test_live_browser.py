"""The live view, the playback of a run and an exported page in a real browser."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from live_page import CHROMIUM, open_show, pixels, screen_place, slider, wait_for

from annelid.config import load_config
from annelid.simulation.loop import simulate
from annelid.simulation.runfile import Run
from annelid.simulation.worm import WormPlant

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here to open pages with")

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

    from annelid.live.show import Show

VIEW = {"width": 760, "height": 480}
MOVED = 1.0
"""Mean change of a pixel's value beyond which something has moved."""


@pytest.fixture(scope="module")
def short_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    config = load_config("riddle2023-rods", {"duration_s": 0.6})
    return simulate(config, tmp_path_factory.mktemp("short") / "run", progress=False)


@pytest.fixture(scope="module")
def live(browser: Browser) -> Iterator[tuple[Show, Page]]:
    with open_show(load_config("riddle2023-rods")) as show:
        page = browser.new_page(viewport=VIEW)  # type: ignore[arg-type]
        strangers: list[str] = []
        page.on("request", lambda request: None if of_page(request.url, show) else strangers.append(request.url))
        page.goto(show.address)
        page.wait_for_selector("text=Nervous system", timeout=60_000)
        wait_for(show.clients, page)
        yield show, page
        page.close()
        assert strangers == []


def of_page(url: str, show: Show) -> bool:
    return url.startswith((show.address, show.address.replace("http", "ws"), "blob:", "data:"))


def plant_of(show: Show) -> WormPlant:
    assert show.player.worm is not None
    return show.player.worm.plant


def ask(show: Show, page: Page, *call: object) -> None:
    """Has the loop do something, and waits until it has."""
    done: list[bool] = []
    show.requests.add(*call)  # type: ignore[arg-type]
    show.requests.add(done.append, True)
    wait_for(lambda: done, page)


def test_the_worm_moves_and_holds_still(live: tuple[Show, Page]) -> None:
    show, page = live
    first = pixels(page)
    begun = show.player.moment.time_s
    wait_for(lambda: show.player.moment.time_s > begun + 0.5, page)
    wait_for(lambda: np.abs(pixels(page) - first).mean() > MOVED, page)
    page.get_by_role("button", name="Play / pause").click()
    wait_for(lambda: not show.player.playing, page)
    page.wait_for_timeout(500)
    still = pixels(page)
    page.wait_for_timeout(300)
    assert np.abs(pixels(page) - still).mean() < 0.1 * MOVED


def test_the_panel_says_what_is_seen(live: tuple[Show, Page]) -> None:
    show, page = live
    for words in ("riddle2023-rods", "activation 0 to 1", "force of the ground", "sensor tolerance (mm)"):
        assert page.get_by_text(words).count() > 0
    charts = "Object.values(window.__viserTestpoints.uplots).map(plot => plot.chart.data.length)"
    assert page.evaluate(charts) == [7]
    ask(show, page, show.panel.choose_plot, "neurons of segment 2")
    wait_for(lambda: page.evaluate(charts) == [5], page)


def test_a_slider_changes_the_physics(live: tuple[Show, Page]) -> None:
    show, page = live
    assert touching(show) == {1.0}
    slider(page, "friction").press("Home")
    wait_for(lambda: touching(show) == {0.01}, page)
    page.get_by_role("button", name="Reset sliders").click()
    wait_for(lambda: touching(show) == {1.0}, page)
    wait_for(lambda: slider(page, "friction").get_attribute("aria-valuenow") == "1", page)


def touching(show: Show) -> set[float]:
    """Friction of all that can touch."""
    model = plant_of(show).model
    return set(model.geom_friction[(model.geom_contype != 0) | (model.geom_conaffinity != 0), 0].tolist())


def test_keys_do_what_their_list_says(live: tuple[Show, Page]) -> None:
    show, page = live
    page.locator("body").press("?")
    listed = page.get_by_role("dialog")
    listed.wait_for()
    assert listed.get_by_text("reset the sliders").is_visible()
    page.keyboard.press("Escape")
    listed.wait_for(state="hidden")
    playing = show.player.playing
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("Space")
    wait_for(lambda: show.player.playing is not playing, page)
    page.keyboard.press("l")
    wait_for(lambda: show.player.playing, page)


def test_neurons_take_the_colours_of_their_potentials(live: tuple[Show, Page]) -> None:
    _, page = live
    color = "getComputedStyle(document.querySelector('#neuron-0 path')).fill"
    seen: set[str] = set()
    wait_for(lambda: seen.add(page.evaluate(color)) or len(seen) > 1, page)
    assert page.locator(".annelid-network").get_by_text("U1", exact=True).count() == 3


def test_a_clip_is_recorded_and_saved(live: tuple[Show, Page], tmp_path: Path) -> None:
    _, page = live
    page.get_by_role("button", name="Record clip").click()
    stop = page.get_by_role("button", name="Stop and save")
    stop.wait_for()
    page.wait_for_timeout(1000)
    with page.expect_download() as saved:
        stop.click()
    saved.value.save_as(tmp_path / "clip.webm")
    assert (tmp_path / "clip.webm").read_bytes()[:4] == bytes.fromhex("1a45dfa3")


def test_scrubbing_shows_the_past_and_now_the_present(live: tuple[Show, Page]) -> None:
    show, page = live
    slider(page, "time (s)").press("Home")
    wait_for(lambda: show.player.moment.time_s == show.player.history.span_s[0], page)
    assert not show.player.playing
    page.get_by_role("button", name="Live").click()
    wait_for(lambda: show.player.at_end and show.player.playing, page)


def test_a_click_pokes_the_worm(live: tuple[Show, Page]) -> None:
    show, page = live
    ask(show, page, show.player.pause)
    page.wait_for_timeout(500)
    points, middle = show.stage.picture.strands.reshape(-1, 3).astype(float), show.stage.picture.middle
    x, y = screen_place(show, points[np.abs(points - middle).sum(axis=1).argmin()] + show.stage.shift_m)
    canvas = page.locator("canvas").first.bounding_box()
    assert canvas is not None
    page.mouse.click(canvas["x"] + x * canvas["width"], canvas["y"] + y * canvas["height"])
    wait_for(lambda: plant_of(show).data.xfrc_applied.any(), page)
    force = plant_of(show).data.xfrc_applied[:, :3].sum(axis=0)
    [client] = show.clients()
    away = show.stage.picture.middle - client.camera.position
    assert force @ away > 0.8 * np.linalg.norm(force) * np.linalg.norm(away)


@pytest.mark.slow
def test_a_run_is_played_the_same_way(browser: Browser, short_run: Run) -> None:
    with open_show(short_run) as show:
        page = browser.new_page(viewport=VIEW)  # type: ignore[arg-type]
        page.goto(show.address)
        page.wait_for_selector("text=Nervous system", timeout=60_000)
        wait_for(show.clients, page)
        assert page.get_by_text("Physics").count() == 0
        wait_for(lambda: show.player.at_end and not show.player.playing, page)
        page.wait_for_timeout(500)
        last = pixels(page)
        slider(page, "time (s)").press("Home")
        wait_for(lambda: show.player.moment.time_s == 0.0, page)
        wait_for(lambda: np.abs(pixels(page) - last).mean() > MOVED, page)
        page.close()


def test_an_exported_page_opens_from_disk_without_a_network(browser: Browser, short_run: Run, tmp_path: Path) -> None:
    from annelid.live.page import export_page

    path = export_page(short_run, tmp_path / "walk")
    context = browser.new_context(viewport=VIEW, offline=True)  # type: ignore[arg-type]
    page = context.new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(path.as_uri())
    page.wait_for_selector("canvas", timeout=60_000)
    clock = page.locator("input").first
    begun = clock.input_value()
    wait_for(lambda: clock.input_value() != begun, page)
    page.keyboard.press("Space")
    clock.fill("0.0")
    page.wait_for_timeout(500)
    first = pixels(page)
    clock.fill("0.5")
    wait_for(lambda: np.abs(pixels(page) - first).mean() > MOVED, page)
    assert page.get_by_text("activation 0 to 1").count() == 1
    assert "riddle2023-rods" in page.title()
    assert [url for url in asked if not url.startswith(("file:", "blob:", "data:"))] == []
    context.close()
