# SPDX-License-Identifier: Apache-2.0
"""Writes a measured page, and notices results that were changed by hand later.

    python -m rtl.report_page            pages of docs/reports with other results; exit 1 when there is one
    python -m rtl.report_page FILE...    accepts the results of these pages as they are

Every command that measures writes its page through `write_page`. The folder's numbers.json then has a
checksum of the page's results, in their order: all numbers and fingerprints, the rows of its tables, and
list items that begin with a name in code. Other words may change without it. Accept results by hand only for
what no command printed: a date, or words of a template.
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
RECORD = "numbers.json"
# It comes and goes without a measurement.
NOTICE = re.compile(r"^> \*\*Of an older card\.\*\* .*\n", re.MULTILINE)
RESULT = re.compile(r"^(?:\||- `).*$|`[0-9a-f]{12}`|\d[\d.,]*", re.MULTILINE)


def checksum(text: str) -> str:
    results = (result.rstrip(".,") for result in RESULT.findall(NOTICE.sub("", text)))
    return hashlib.sha256("\0".join(results).encode()).hexdigest()[:16]


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
    """Pages of the folder with other results than their command wrote."""
    record = kept(folder)
    return [
        path for path in sorted(folder.glob("*.md")) if record.get(path.name) != checksum(path.read_text())
    ]


def main() -> int:
    for name in sys.argv[1:]:
        accept(Path(name).resolve())
    found = changed(REPORTS)
    for path in found:
        print(f"{path.relative_to(ROOT)}: its results are not those that its command wrote")
    return 1 if found else 0


if __name__ == "__main__":
    run_main("report_page", main, OSError)
