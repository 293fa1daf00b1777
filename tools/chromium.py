# SPDX-License-Identifier: Apache-2.0
"""Headless Chromium: runs scripts in pages, returns their results and console messages."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

FOUND = re.compile(r'<pre id="found">(.*?)</pre>', re.DOTALL)
CONSOLE = re.compile(r"CONSOLE[:(]\d+\)?\] (.*)")
# No network, no user profile, and no sandbox, which does not work for root.
OPTIONS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--enable-logging=stderr",
)


class Missing(Exception):
    """There is no Chromium."""


@dataclass(frozen=True)
class Seen:
    found: Any
    console: list[str]


def evaluate(page: str, script: str, folder: Path, width: int = 1200, options: tuple[str, ...] = ()) -> Seen:
    """Opens a page, as a file of `folder`, and runs a script in it; `found` is what the script returns.

    The script may `await`; then `options` need `--virtual-time-budget`, or Chromium does not wait for it.
    """
    browser = shutil.which("chromium")
    if browser is None:
        raise Missing("chromium is missing; run `make setup-pages` (Debian package chromium)")
    file = folder / "page.html"
    file.write_text(
        f"{page}\n<script>addEventListener('load', async () => {{\n"
        f"const found = await (async () => {{ {script} }})();\n"
        "const pre = document.createElement('pre');\n"
        "pre.id = 'found'; pre.textContent = JSON.stringify(found); document.body.append(pre);\n"
        "});</script>\n"
    )
    command = [browser, *OPTIONS, f"--user-data-dir={folder / 'profile'}", *options]
    command += [f"--window-size={width},900", "--dump-dom", file.as_uri()]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    found = FOUND.search(run.stdout)
    console = CONSOLE.findall(run.stderr)
    assert found, f"the page's script did not end: {console}"
    return Seen(json.loads(html.unescape(found[1])), console)
