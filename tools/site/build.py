# SPDX-License-Identifier: Apache-2.0
"""Writes the documentation site, readable without a network and without a server, to build/docs-site.

    python -m tools.site.build [FOLDER]     default: build/docs-site

Prints the first page and the number of pages. Timing diagrams come from build/diagrams, if `make diagrams`
has drawn them. A dead link is an error, and so is a page without a place:
exit 1, one line for each. Exit 2 without MkDocs, or for a folder with other files.
"""

from __future__ import annotations

import logging
import os
import sys
from os.path import relpath
from pathlib import Path

from rtl.command import run_main
from rtl.sources import ROOT

CONFIG = Path(__file__).with_name("mkdocs.yml")


def build(site: Path) -> list[str]:
    """Builds the site into a folder; returns its errors, one line each."""
    from mkdocs.commands.build import build as mkdocs_build
    from mkdocs.config import load_config
    from mkdocs.exceptions import MkDocsException

    wrong: list[str] = []
    listener = logging.Handler(logging.WARNING)
    listener.emit = lambda record: wrong.append(" ".join(record.getMessage().split()))
    log = logging.getLogger("mkdocs")
    log.addHandler(listener)
    # Two runs write the same bytes.
    os.environ["SOURCE_DATE_EPOCH"] = "0"
    try:
        config = load_config(str(CONFIG), site_dir=str(site))
        config.plugins.on_startup(command="build", dirty=False)
        mkdocs_build(config)
        config.plugins.on_shutdown()
        (site / "404.html").unlink()  # for servers
    except MkDocsException as error:
        wrong += [] if wrong else [str(error)]
    finally:
        log.removeHandler(listener)
    return wrong


def main() -> int:
    site = Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else ROOT / "build/docs-site"
    ours = (site / "search/search_index.js").exists()
    if not ours and site.exists() and (site.is_file() or any(site.iterdir())):
        print(f"docs: {relpath(site)} has other files; the site needs a folder of its own", file=sys.stderr)
        return 2
    if wrong := build(site):
        print("\n".join(wrong), file=sys.stderr)
        return 1
    print(f"{relpath(site / 'index.html')}: {len(list(site.rglob('*.html')))} pages")
    if not (ROOT / "build/diagrams").exists():
        print("docs: the timing diagrams are missing; run `make diagrams docs`", file=sys.stderr)
    return 0


if __name__ == "__main__":
    run_main("docs", main, ImportError, OSError)
