# SPDX-License-Identifier: Apache-2.0
"""Opens a recording (.pcapng) with both lines decoded: in Wireshark, or as tshark's text without a display.

    python -m sim.view.wireshark FILE [OPTION...]     options are passed to Wireshark or tshark

Link types, columns and colours are those of sim/view/wireshark_profile, copied to build/wireshark so that
Wireshark may write there; the user's own settings are neither read nor changed.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from rtl.command import run_main

ROOT = Path(__file__).resolve().parents[2]
OURS = ROOT / "sim/view"
SETTINGS = ROOT / "build/wireshark"
SCRIPT = ["-X", f"lua_script:{OURS / 'fc.lua'}"]


def environment(settings: Path = SETTINGS) -> dict[str, str]:
    """Environment in which Wireshark and tshark use this profile, copied to `settings`."""
    settings.mkdir(parents=True, exist_ok=True)
    for path in (OURS / "wireshark_profile").iterdir():
        shutil.copy(path, settings)
    return os.environ | {"WIRESHARK_CONFIG_DIR": str(settings)}


def main() -> int:
    if len(sys.argv) < 2:
        print("name a recording: make wireshark FILE=name.pcapng", file=sys.stderr)
        return 2
    capture, *options = sys.argv[1:]
    if not Path(capture).is_file():
        print(f"wireshark: {capture} does not exist", file=sys.stderr)
        return 2
    has_display = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    if shutil.which("wireshark") and has_display:
        return subprocess.call(["wireshark", *SCRIPT, "-r", capture, *options], env=environment())
    if shutil.which("tshark") is None:
        print(
            "wireshark: neither Wireshark with a display nor tshark is here; run `make setup`",
            file=sys.stderr,
        )
        return 2
    missing = "no display" if shutil.which("wireshark") else "no Wireshark"
    print(f"wireshark: {missing} here, so this is tshark's text", file=sys.stderr)
    return subprocess.call(["tshark", *SCRIPT, "-2", "-P", "-V", "-r", capture, *options], env=environment())


if __name__ == "__main__":
    run_main("wireshark", main)
