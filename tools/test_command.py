# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C: every command ends with one line and exit code 130, and nothing that it started goes on."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tb.lib.runner import ROOT
from tools.lint import name, source_files

MAIN = re.compile(r'^if __name__ == "__main__":\n(.+)', re.DOTALL | re.MULTILINE)

# Steps of a build and the agents' example start as files, outside the project's packages. `rtu2fc`
# stops a motor first.
OTHERS = ("sim/drive/drive_table.py", "sw/tools/bin2hex.py", "sw/tools/seal.py", "sw/tools/stack.py")
OTHERS += (
    "sw/rtu2fc/__main__.py",
    "sw/rtu2fc/setup.py",
    "sw/conformance/setup.py",
    "tb/agents/example/run.py",
)
# Two workers and more work than they do in a minute. Each piece says that it begins, with one write.
POOL = """import subprocess, sys, time
from rtl.command import in_processes, run_main, threads
def calculate(number):
    sys.stdout.write("begun\\n")
    time.sleep(40)
def program(number):
    subprocess.run(["sh", "-c", "echo begun; exec sleep 40"])
def processes():
    list(in_processes(2, calculate, range(8)))
def programs():
    with threads(2) as pool:
        list(pool.map(program, range(8)))
run_main("work", locals()[sys.argv[1]])
"""


def stopped(*words: str, begun: str, times: int = 1) -> tuple[int, str]:
    """Starts Python, presses Ctrl-C after `times` lines that hold `begun`; returns exit code and errors."""
    test = subprocess.Popen(
        [sys.executable, *words],
        cwd=ROOT,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # A shell starts its background jobs with Ctrl-C ignored, and the tests may run in one.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    try:
        while times:
            line = test.stdout.readline()
            assert line, test.stderr.read()
            times -= begun in line
        os.killpg(test.pid, signal.SIGINT)  # as a terminal does: to all that run in the foreground
        _, errors = test.communicate(timeout=20)
    finally:
        left = running(test.pid)
        if left:
            os.killpg(test.pid, signal.SIGKILL)
    assert not left, "something still runs"
    return test.returncode, errors


def running(group: int) -> list[str]:
    """Processes of a group. A bare Debian has no pgrep."""
    found = []
    for about in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, _, its_group, *_ = about.read_text().rpartition(")")[2].split()
            found += [about.parent.name] if int(its_group) == group and state != "Z" else []
    return found


@pytest.mark.parametrize("kind", ["processes", "programs"])
def test_ctrl_c_ends_workers_without_a_word(kind):
    assert stopped("-c", POOL, kind, begun="begun", times=2) == (130, "work: stopped\n")


def test_ctrl_c_ends_the_setup_in_one_line(tmp_path):
    slow = tmp_path / "python3"
    slow.write_text("#!/bin/sh\necho begun\nexec sleep 40\n")
    slow.chmod(0o755)
    program = f"""import os
os.environ["PATH"] = "{tmp_path}:" + os.environ["PATH"]
os.execv("tools/setup.sh", ["tools/setup.sh", "demo"])"""
    assert stopped("-c", program, begun="begun") == (130, "setup: stopped\n")


def test_ctrl_c_while_pytest_collects():
    """pytest.main() returns after Ctrl-C, with the exit code of a wrong collection."""
    program = """import sys, time
from rtl.command import run_main
from tools import trace
class Slow(trace.Collector):
    def pytest_collection(self):
        print("begun", file=sys.__stdout__)
        time.sleep(30)
trace.Collector = Slow
run_main("trace", trace.collect)"""
    assert stopped("-c", program, begun="begun") == (130, "trace: stopped\n")


PIPES = """import subprocess, sys
from rtl.command import run_main
def printing():
    for number in range(100000):
        print(number)
def feeding():
    card = subprocess.Popen(["true"], stdin=subprocess.PIPE)
    card.wait()
    card.stdin.write(b"state" * 100000)
run_main("pipes", {"printing": printing, "feeding": feeding}[sys.argv[1]])
"""


@pytest.mark.parametrize(("what", "code"), [("printing", 0), ("feeding", 1)])
def test_a_reader_that_stops_is_no_error_and_a_program_that_ended_is_one(what, code):
    command = [sys.executable, "-c", PIPES, what]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as started:
        started.stdout.readline()
        started.stdout.close()
        assert started.wait(20) == code
        assert (b"BrokenPipeError" in started.stderr.read()) == bool(code)


def test_every_command_has_its_version():
    """By run_main, which is in every command; `rtu2fc` has its own end."""
    number = (ROOT / "VERSION").read_text().strip()
    for words, its_name in (
        ((sys.executable, "-m", "tools.prose"), ", prose"),
        ((sys.executable, "-m", "sw.rtu2fc"), ""),
        (("tools/setup.sh",), ", setup"),
    ):
        done = subprocess.run([*words, "--version"], cwd=ROOT, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout, done.stderr) == (0, f"rtu2fc {number}{its_name}\n", "")


def test_every_command_ends_by_the_same_function():
    texts = {name(path): path.read_text() for path in source_files() if path.suffix == ".py"}
    ends = {file: found[1] for file, text in texts.items() if (found := MAIN.search(text))}
    assert set(OTHERS) < ends.keys() and len(ends) > 40
    for file in ends.keys() - set(OTHERS):
        assert re.search(r"^    run_main\(\"[a-z_0-9-]+\", .+\)\n\Z", ends[file], re.MULTILINE), file
