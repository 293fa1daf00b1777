# SPDX-License-Identifier: Apache-2.0
"""For tools that are started by their path and need packages of .venv: imported first, it goes on in there.

The shell's python3 knows neither pywellen nor the rest. Without .venv: one line, exit code 2.
"""

import os
import sys
from pathlib import Path

VENV = Path(__file__).resolve().parents[1] / ".venv"

if Path(sys.prefix).resolve() != VENV.resolve():
    try:
        os.execv(VENV / "bin/python", [VENV / "bin/python", *sys.argv])
    except OSError:
        print(f"{Path(sys.argv[0]).stem}: {VENV} is not there; run `make setup`", file=sys.stderr)
        sys.exit(2)
