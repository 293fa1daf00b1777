# SPDX-License-Identifier: Apache-2.0
"""Reads captures with Wireshark's tshark, for tests."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

TIMEOUT_S = 60


def _run(command: Sequence[object], env: Mapping[str, str] | None = None) -> str:
    words = list(map(str, command))
    done = subprocess.run(words, capture_output=True, text=True, timeout=TIMEOUT_S, check=False, env=env)
    assert done.returncode == 0, f"{' '.join(map(str, command))}: {done.stderr}"
    return done.stdout


def fields(
    capture: Path,
    *names: str,
    options: Sequence[str] = (),
    only: str = "",
    env: Mapping[str, str] | None = None,
) -> list[dict[str, str]]:
    """Fields of every packet that passes the display filter `only`.

    Several values of a field are joined by `;`; an absent field is empty.
    """
    asked = [word for name in names for word in ("-e", name)]
    chosen = ["-Y", only] if only else []
    form = ["-T", "fields", "-E", "separator=/t", "-E", "aggregator=;", "-E", "occurrence=a"]
    text = _run(["tshark", "-n", *options, "-r", capture, *chosen, *form, *asked], env)
    return [dict(zip(names, line.split("\t"), strict=True)) for line in text.splitlines()]


def rows(capture: Path, options: Sequence[str] = (), env: Mapping[str, str] | None = None) -> list[str]:
    """Packet list with tab-separated columns."""
    return _run(["tshark", "-n", *options, "-r", capture, "-T", "tabs"], env).splitlines()
