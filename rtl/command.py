# SPDX-License-Identifier: Apache-2.0
"""Common to all commands: `--version`, one line for a wrong option and after Ctrl-C.

A reader that closes the output early (`| head`) is no error.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import select
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import NoReturn, TypeVar

VERSION = Path(__file__).resolve().parents[1] / "VERSION"
T = TypeVar("T")
R = TypeVar("R")
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
    except (BrokenPipeError, *errors) as error:
        if isinstance(error, BrokenPipeError) and reader_has_gone():
            stop_printing()
            sys.exit(0)
        if not isinstance(error, errors):
            raise
        print(f"{name}: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second Ctrl-C must not stop the end
        print(f"{name}: stopped", file=sys.stderr)
        sys.exit(STOPPED)


def own_environment() -> dict[str, str]:
    """For a make that is started: without the variables of the make above."""
    return {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}


def write_files(name: str, about: str, files: dict[Path, str], make: str) -> int:
    """The command of a generator: writes the files that differ, or with --check names them."""
    parser = Parser(prog=name, description=about.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare only, exit 1 on a difference")
    check = parser.parse_args().check
    old = [path for path, text in files.items() if not path.exists() or path.read_text() != text]
    for path in old:
        shown = path.relative_to(VERSION.parent)
        if check:
            print(f"{shown} differs from its source; run `{make}`", file=sys.stderr)
        else:
            path.write_text(files[path])
            print(f"wrote {shown}")
    return 1 if old and check else 0


def _end_by_ctrl_c() -> None:
    """For a worker process: Ctrl-C ends it silently; its parent prints the line."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def in_processes(count: int, function: Callable[[T], R], pieces: Iterable[T]) -> Iterator[R]:
    """Yields `function` of each piece, as worker processes finish them. Ctrl-C ends the workers.

    No worker is replaced. multiprocessing.Pool starts new ones after Ctrl-C, and its end may wait for ever.
    """
    with ProcessPoolExecutor(count, initializer=_end_by_ctrl_c) as pool:
        try:
            for done in as_completed([pool.submit(function, piece) for piece in pieces]):
                yield done.result()
        except BaseException:
            interrupt_children()
            pool.shutdown(cancel_futures=True)
            raise


@contextlib.contextmanager
def threads(count: int) -> Iterator[ThreadPoolExecutor]:
    """A pool for tasks that start programs. After Ctrl-C no task begins, and the started programs end."""
    with ThreadPoolExecutor(count) as pool:
        try:
            yield pool
        except BaseException:
            ending = threading.Thread(target=pool.shutdown, kwargs={"cancel_futures": True})
            ending.start()
            while ending.is_alive():
                # Repeat the signal: a task may start after Ctrl-C, and a starting process may miss it.
                interrupt_children()
                ending.join(1)
            raise


def interrupt_children() -> None:
    """Ctrl-C for every process that this one has started."""
    pids: list[str] = []
    for of_thread in Path("/proc/self/task").glob("*/children"):
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # the thread has ended
            pids += of_thread.read_text().split()
    for pid in pids:
        with contextlib.suppress(ProcessLookupError):
            os.kill(int(pid), signal.SIGINT)


def reader_has_gone() -> bool:
    """Whether the output is a pipe without a reader. A pipe to a program that was started may break, too."""
    output = select.poll()
    output.register(sys.__stdout__.fileno(), 0)
    return any(events & select.POLLERR for _, events in output.poll(0))


def stop_printing() -> None:
    """Discards the rest of the output: its reader has gone, and Python would fail when it writes it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
