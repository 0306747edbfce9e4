"""The browser of the tests, and a check of how a page looks."""

import shutil
from pathlib import Path

# as .ci/browser looks for them
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (  # SwiftShader draws WebGL alone: for the rest of a page it takes three times as long
    "--no-sandbox", "--use-angle=swiftshader-webgl", "--enable-unsafe-swiftshader",
    "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
)  # fmt: skip
LOOKS = (Path(__file__).parent / "looks.js").read_text(encoding="utf-8")  # finds faults of a look
LEAST, SMALL = 4.5, 8.0  # least contrast of text (WCAG 2.2, AA), least height of letters [px]


def browser_path() -> str | None:
    """Return the path of an installed browser, or None for Playwright's own."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)
