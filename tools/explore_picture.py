"""Take the picture of the live page for the documentation: ``python tools/explore_picture.py``, with Chromium."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))
import browser  # noqa: E402  # of the tests

TARGET = ROOT / "docs" / "images" / "explore.png"
CONFIG = ROOT / "experiments" / "robles2023" / "chapter3" / "contois_te025.yaml"
_TWO = (
    f"extends: {CONFIG}\nobservers: {{FHGO r=1: null, FHGO r=3: null}}\nfigures: null\nclaims: null\n"  # all are high
)
_WIDTH, _HEIGHT, _COLOURS = 1300, 1420, 128


async def _look(page: browser.Page) -> None:
    await page.resize(_WIDTH, _HEIGHT)
    await page.until("window.hgorun && hgorun.idle")
    await page.value("document.querySelector('.fold').click()")  # the plant's sliders
    await asyncio.sleep(5)
    await page.picture(TARGET)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / CONFIG.name).write_text(_TWO)
        command = [sys.executable, "-m", "hgorun", "explore", CONFIG.name, "--no-browser", "-q"]
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True, env=environment)
        try:
            assert process.stdout is not None
            browser.opened(process.stdout.readline().strip(), _look)
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(30)
    with Image.open(TARGET) as image:
        small = image.convert("RGB").resize((_WIDTH * 3 // 5, _HEIGHT * 3 // 5), Image.Resampling.LANCZOS)
    small.quantize(_COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(TARGET, optimize=True)


if __name__ == "__main__":
    main()
