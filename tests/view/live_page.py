"""A headless Chromium that draws WebGL in software, for the tests of pages; and a view that runs beside it."""

from __future__ import annotations

import math
import re
import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter, sleep
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from playwright.sync_api import Locator, Page

    from annelid.config import RunConfig
    from annelid.live.show import Show
    from annelid.simulation.runfile import Run

_NAMES = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = next((path for name in _NAMES if (path := shutil.which(name))), None)
ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
ARGUMENTS += ["--disable-gpu-compositing"]
PATIENCE_S = 120.0


def wait_for(is_so: Callable[[], object], page: Page | None = None) -> None:
    """Waits until something is so; gives up after what a busy machine may need."""
    end = perf_counter() + PATIENCE_S
    while not is_so():
        assert perf_counter() < end, "it did not happen in time"
        if page is None:
            sleep(0.05)
        else:
            page.wait_for_timeout(50)


@contextmanager
def open_show(source: RunConfig | Run) -> Iterator[Show]:
    """A view on a port of its own, whose loop runs in a thread."""
    from annelid.live.show import Show

    with Show(source) as show:
        loop = threading.Thread(target=show.run)
        loop.start()
        try:
            yield show
        finally:
            show.end()
            loop.join(60)


def pixels(page: Page) -> np.ndarray:
    """What the page's scene shows, ``(height, width, 3)``."""
    import imageio.v3

    return np.asarray(imageio.v3.imread(page.locator("canvas").first.screenshot(timeout=60_000)))[..., :3].astype(int)


def slider(page: Page, label: str) -> Locator:
    """The thumb of the slider of that label, which the keyboard moves."""
    control = page.locator("label", has_text=re.compile(f"^{re.escape(label)}$")).get_attribute("for")
    return page.locator(f'[id="{control}"] [role=slider]')


def screen_place(show: Show, point_m: np.ndarray) -> tuple[float, float]:
    """Where a point of the page's axes appears, as shares of the canvas' width and height."""
    [client] = show.clients()
    camera = client.camera
    w, x, y, z = camera.wxyz
    axes = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    right, down, ahead = (point_m - camera.position) @ axes
    half = math.tan(camera.fov / 2) * ahead
    return 0.5 + right / (2 * half * camera.aspect), 0.5 + down / (2 * half)
