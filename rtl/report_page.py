# SPDX-License-Identifier: Apache-2.0
"""Writes a measured page, and notices what was changed by hand later.

    python -m rtl.report_page            pages and pictures that were changed; exit 1 when there is one
    python -m rtl.report_page FILE...    accepts these files as they are

Every command that measures writes its page through `write_page`, and its pictures through
campaigns/plots.py. The folder's numbers.json then has a checksum of the file, without its notice. Accept a
page by hand only after a change of words in its template: no command printed them.
"""

from __future__ import annotations

import hashlib
import json
import re
import sys
from pathlib import Path

from rtl.command import run_main
from rtl.sources import ROOT

REPORTS = ROOT / "docs/reports"
FOLDERS = (REPORTS, ROOT / "docs/pictures")
RECORD = "numbers.json"
# It comes and goes without a measurement.
NOTICE_HEAD = "> **Out of date.** "
NOTICE = re.compile(rf"^{re.escape(NOTICE_HEAD)}.*\n\n?", re.MULTILINE)


def checksum(text: str) -> str:
    return hashlib.sha256(NOTICE.sub("", text).encode()).hexdigest()[:16]


def kept(folder: Path) -> dict[str, str]:
    path = folder / RECORD
    return json.loads(path.read_text()) if path.exists() else {}


def accept(path: Path) -> None:
    record = kept(path.parent) | {path.name: checksum(path.read_text())}
    (path.parent / RECORD).write_text(json.dumps(dict(sorted(record.items())), indent=1) + "\n")


def write_page(path: Path, text: str) -> None:
    path.write_text(text)
    accept(path)


def changed(folder: Path) -> list[Path]:
    """Pages and recorded pictures of the folder that are not as their command wrote them, or not there."""
    record = kept(folder)
    files = sorted({*folder.glob("*.md"), *(folder / name for name in record)})
    return [
        path for path in files if not path.exists() or record.get(path.name) != checksum(path.read_text())
    ]


def main() -> int:
    for name in sys.argv[1:]:
        accept(Path(name).resolve())
    found = [path for folder in FOLDERS for path in changed(folder)]
    for path in found:
        print(f"{path.relative_to(ROOT)}: it is not as its command wrote it")
    return 1 if found else 0


if __name__ == "__main__":
    run_main("report_page", main, OSError)
