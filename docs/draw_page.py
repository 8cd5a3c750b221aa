"""Picture of the first screen of a page, by headless Chromium: ``python docs/draw_page.py PAGE.html OUT.png``."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

SCREEN = (1280, 800)
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def screenshot(page: Path, out: Path) -> None:
    """Write the picture, in few colours."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        print(f"{out} is left as it is: none of {', '.join(BROWSERS)} is installed")
        return
    with TemporaryDirectory() as folder:
        seen = Path(folder) / "page.png"
        options = [
            f"--user-data-dir={folder}/profile",
            f"--window-size={SCREEN[0]},{SCREEN[1]}",
            f"--screenshot={seen}",
        ]
        always = ["--headless=new", "--no-sandbox", "--hide-scrollbars", "--force-device-scale-factor=1"]
        command = [browser, *always, *options, page.resolve().as_uri()]
        subprocess.run(command, check=True, capture_output=True, timeout=120)
        Image.open(seen).convert("RGB").quantize(64).save(out, optimize=True)


if __name__ == "__main__":
    screenshot(Path(sys.argv[1]), Path(sys.argv[2]))
