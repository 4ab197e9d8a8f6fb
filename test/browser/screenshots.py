"""Take the pictures of a report that the documentation shows, at the width of a desk and of a telephone.

.venv/bin/sms-handover report runs/nmpc runs/pid
.venv/bin/python test/browser/screenshots.py report/index.html
"""

import sys
from argparse import ArgumentParser
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image
from playwright.sync_api import Browser, sync_playwright

if TYPE_CHECKING:
    from test.browser.chromium import ARGUMENTS, NARROW, WIDE, absence, find_chromium
else:
    from chromium import ARGUMENTS, NARROW, WIDE, absence, find_chromium

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "images"
HEIGHTS = {WIDE[0]: 2000, NARROW[0]: 2300}  # [px] of a picture, from the top of the page
COLOURS = 256  # of a picture, which keeps it small
MOMENT = 21.5  # [s] of the run that the animation shows: the deputy is on its way


def picture(browser: Browser, page_file: Path, width: int, target: Path) -> None:
    """Write what a browser of some width shows of a report, once everything is drawn."""
    context = browser.new_context(viewport={"width": width, "height": HEIGHTS[width]}, color_scheme="light")
    page = context.new_page()
    page.goto(page_file.resolve().as_uri())
    page.evaluate("() => drawn")
    inside = page.frames[1]
    inside.evaluate("t => player.seek(t)", MOMENT)
    inside.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    drawn = Image.open(BytesIO(page.screenshot()))
    drawn.quantize(COLOURS).save(target, optimize=True)
    context.close()
    print(f"{target}: {target.stat().st_size / 1000:.0f} kB")


def main() -> int:
    """Take both pictures; the exit code is 1 where there is no browser."""
    parser = ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("report", type=Path, help="page that sms-handover report has written")
    parser.add_argument("--output", type=Path, default=IMAGES, metavar="FOLDER", help="default: docs/images")
    options = parser.parse_args()
    executable = find_chromium()
    if executable is None:
        print(absence(), file=sys.stderr)
        return 1
    options.output.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=list(ARGUMENTS))
        for width in HEIGHTS:
            picture(browser, options.report, width, options.output / f"report_{width}.png")
        browser.close()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
