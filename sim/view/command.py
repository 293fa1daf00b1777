# SPDX-License-Identifier: Apache-2.0
"""Common to the commands that print rows: one line for a wrong option, no error when a reader stops."""

from __future__ import annotations

import argparse
import os
import sys


class Parser(argparse.ArgumentParser):
    """One line for a wrong option, and exit code 2."""

    def error(self, message: str) -> None:
        self.exit(2, f"{self.prog}: {message}\n")


def stop_printing() -> None:
    """Drops what is left of the output, so that Python does not fail on it at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
