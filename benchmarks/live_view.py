"""Pictures a second that reach a headless Chromium from a worm that runs live, and how fast the worm runs meanwhile.

    python benchmarks/live_view.py [PRESET] [SECONDS] [PIXELS]

PIXELS are device pixels per pixel of the page, 2 on a screen of high resolution.

A picture has reached the browser when it hands the strands to WebGL, which it does anew for each: uploads of just their
size are counted, two a picture, since the colours are as large as the places. Chromium draws in software here, on the
same cores as the worm; a browser with a graphics card leaves these to the worm.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import threading
from time import perf_counter, process_time, sleep

import psutil
from playwright.sync_api import sync_playwright

from annelid.config import load_config
from annelid.live.show import Show

COUNT_UPLOADS = """
window.uploads = {};
const upload = WebGL2RenderingContext.prototype.bufferData;
WebGL2RenderingContext.prototype.bufferData = function (...given) {
  const size = given[1].byteLength;
  window.uploads[size] = (window.uploads[size] || 0) + 1;
  return upload.apply(this, given);
};
"""
ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
# Else the page around the scene is put together by the same software renderer, which takes as long as the scene.
ARGUMENTS += ["--disable-gpu-compositing"]
WARM_UP_S = 5.0


def browser_s() -> dict[str, float]:
    """Processor time of Chromium's processes, s: the page's own, and the one that draws."""
    spent = {"renderer": 0.0, "gpu-process": 0.0}
    for process in psutil.Process().children(recursive=True):
        for kind in spent:
            if f"--type={kind}" in process.cmdline():
                spent[kind] += sum(process.cpu_times()[:2])
    return spent


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("preset", nargs="?", default="riddle2023-rods")
    parser.add_argument("seconds", nargs="?", type=float, default=15.0)
    parser.add_argument("pixels", nargs="?", type=float, default=1.0)
    given = parser.parse_args()
    preset, seconds, pixels = given.preset, given.seconds, given.pixels
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if chromium is None:
        sys.exit("there is no Chromium here")
    with Show(load_config(preset)) as show, sync_playwright() as playwright:
        loop = threading.Thread(target=show.run)
        loop.start()
        try:
            browser = playwright.chromium.launch(executable_path=chromium, args=ARGUMENTS)
            page = browser.new_page(viewport={"width": 1000, "height": 560}, device_scale_factor=pixels)
            page.add_init_script(COUNT_UPLOADS)
            page.goto(show.address)
            page.wait_for_selector("text=Nervous system", timeout=60_000)
            sleep(WARM_UP_S)
            size = show.stage.picture.strands.nbytes

            def reading() -> tuple[float, float, int, float, float]:
                uploads = page.evaluate(f"window.uploads[{size}] || 0")
                own = process_time()
                return perf_counter(), show.player.moment.time_s, show.frames_drawn, uploads / 2, own

            spent, before = browser_s(), reading()
            sleep(seconds)
            passed, simulated, sent, drawn, own = (after - b for after, b in zip(reading(), before, strict=True))
            spent = {kind: all_s - spent[kind] for kind, all_s in browser_s().items()}
            browser.close()
        finally:
            show.end()
            loop.join()
    print(f"{preset}: {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print(f"simulated over real time  {simulated / passed:6.2f}")
    print(f"pictures sent a second    {sent / passed:6.1f}")
    print(f"pictures drawn a second   {drawn / passed:6.1f}")
    print(f"cores used by the worm and its server  {own / passed:6.2f}")
    print(f"cores used by the page            {spent['renderer'] / passed:6.2f}")
    print(f"cores used to draw it             {spent['gpu-process'] / passed:6.2f}")


if __name__ == "__main__":
    main()
