"""Take the pictures in the documents of these themselves, of a report and of the live view.

Each at the width of a desk and of a telephone, as PNG of few colours, which keeps it small.
"""

import sys
from argparse import ArgumentParser
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from sms_handover.bag.info import read_info
from sms_handover.bag.run.reader import read_run
from sms_handover.launcher.run_folder import bag_of
from sms_handover.scene.live import LiveScene
from sms_handover.scene.recorded_scene import deputy_size_in, read_scene
from sms_handover.scene.server import SceneServer

if TYPE_CHECKING:
    from test.browser.chromium import ARGUMENTS, NARROW, WIDE, absence, find_chromium
    from test.core.scene_documents import play
else:  # the standard library has a package of the name test
    sys.path.append(str(Path(__file__).resolve().parents[1]))
    from browser.chromium import ARGUMENTS, NARROW, WIDE, absence, find_chromium
    from core.scene_documents import play

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "images"
WIDTHS = (WIDE[0], NARROW[0])
LARGEST = 300  # [kB] of a picture
COLOURS = 256  # of a picture
MOMENT = 21.5  # [s] of the run that is shown: the deputy is on its way
TWO_FRAMES = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


@contextmanager
def opened(browser: Browser, address: str, width: int, height: int) -> Iterator[Page]:
    """Open a page in a window of some size, in light colours."""
    context = browser.new_context(viewport={"width": width, "height": height}, color_scheme="light")
    page = context.new_page()
    page.goto(address)
    yield page
    context.close()


def keep(page: Page, target: Path) -> None:
    """Write what a page shows; raises SystemExit if it takes too much room."""
    Image.open(BytesIO(page.screenshot())).quantize(COLOURS).save(target, optimize=True)
    size = target.stat().st_size / 1000
    print(f"{target}: {size:.0f} kB")
    if size > LARGEST:
        raise SystemExit(f"{target} has {size:.0f} kB, allowed are {LARGEST} kB")


def take_report(browser: Browser, file: Path, folder: Path) -> None:
    """Take pictures of a report, once everything is drawn."""
    for width, height in zip(WIDTHS, (2000, 2300), strict=True):  # [px]
        with opened(browser, file.resolve().as_uri(), width, height) as page:
            page.evaluate("() => drawn")
            inside = page.frames[1]
            inside.evaluate("t => player.seek(t)", MOMENT)
            inside.evaluate(TWO_FRAMES)
            keep(page, folder / f"report_{width}.png")


def take_site(browser: Browser, site: Path, folder: Path) -> None:
    """Take pictures of the front page of the site, and of a page with formulas."""
    for name in ("index", "dynamics"):
        for width, height in zip(WIDTHS, (900, 844), strict=True):  # [px]
            with opened(browser, (site.resolve() / f"{name}.html").as_uri(), width, height) as page:
                page.evaluate(TWO_FRAMES)
                keep(page, folder / f"site_{name}_{width}.png")


def take_live(browser: Browser, run: Path, folder: Path) -> None:
    """Take pictures of the page that follows a graph, which a recorded run stands in for."""
    bag = bag_of(run)
    info = read_info(bag)
    live = LiveScene(info.urdf_text or "", deputy_size_in(info))
    scene = read_scene(bag)
    play(live, read_run(bag), scene, slice(0, int(np.searchsorted(scene.stamp_ns, MOMENT * 1e9))))
    server = SceneServer(lambda: live, 0, "Handover, live")
    for width, height in zip(WIDTHS, (800, 760), strict=True):  # [px]
        with opened(browser, server.address, width, height) as page:
            page.wait_for_function(f"window.player && player.t > {MOMENT - 0.2}")
            page.evaluate(TWO_FRAMES)
            keep(page, folder / f"live_{width}.png")
    server.close()


def main() -> int:
    """Take all pictures; the exit code is 1 where there is no browser."""
    parser = ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("report", type=Path, help="page that sms-handover report has written")
    parser.add_argument("site", type=Path, help="folder that make docs has written")
    parser.add_argument("run", type=Path, help="run that the live view shows")
    parser.add_argument("--output", type=Path, default=IMAGES, metavar="FOLDER", help="default: docs/images")
    options = parser.parse_args()
    executable = find_chromium()
    if executable is None:
        print(absence(), file=sys.stderr)
        return 1
    options.output.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=list(ARGUMENTS))
        take_report(browser, options.report, options.output)
        take_site(browser, options.site, options.output)
        take_live(browser, options.run, options.output)
        browser.close()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
