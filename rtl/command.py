# SPDX-License-Identifier: Apache-2.0
"""Common to all commands: `--version`, one line for a wrong option and after Ctrl-C.

A reader of the output that stops is no error.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NoReturn

VERSION = Path(__file__).resolve().parents[1] / "VERSION"
STOPPED = 130  # the exit code after Ctrl-C, as shells give it


class Parser(argparse.ArgumentParser):
    """One line for a wrong option, and exit code 2."""

    def error(self, message: str) -> None:
        self.exit(2, f"{self.prog}: {message}\n")


def version(name: str) -> str:
    """The line of `--version`, the same in every command and in build/card."""
    return f"rtu2fc {VERSION.read_text().strip()}, {name}"


def run_main(name: str, main: Callable[[], int | None], *errors: type[Exception]) -> NoReturn:
    """Ends the process with the exit code of `main`.

    `--version` alone prints the version instead. Of `errors` the user sees one line, and the exit code is 2.
    After Ctrl-C it is one line and STOPPED.
    """
    if sys.argv[1:] == ["--version"]:
        print(version(name))
        sys.exit()
    try:
        sys.exit(main())
    except errors as error:
        print(f"{name}: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second Ctrl-C must not stop the end
        print(f"{name}: stopped", file=sys.stderr)
        sys.exit(STOPPED)


def end_by_ctrl_c() -> None:
    """For a worker of multiprocessing.Pool: Ctrl-C ends it without a word, its parent has the line."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@contextlib.contextmanager
def threads(count: int) -> Iterator[ThreadPoolExecutor]:
    """A pool for tasks that start programs. After Ctrl-C no task begins, and the started programs end."""
    with ThreadPoolExecutor(count) as pool:
        try:
            yield pool
        except BaseException:
            ending = threading.Thread(target=pool.shutdown, kwargs={"cancel_futures": True})
            ending.start()
            stopped: set[int] = set()
            while ending.is_alive():
                # A task may have begun after Ctrl-C reached the programs of the others.
                for pid in children() - stopped:
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(pid, signal.SIGINT)
                    stopped.add(pid)
                ending.join(0.1)
            raise


def children() -> set[int]:
    """The processes that this one has started."""
    lists = Path("/proc/self/task").glob("*/children")
    return {int(pid) for one in lists for pid in one.read_text().split()}


def stop_printing() -> None:
    """Discards the rest of the output: its reader has gone, and Python would fail when it writes it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
