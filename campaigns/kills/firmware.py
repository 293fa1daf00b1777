# SPDX-License-Identifier: Apache-2.0
"""A process of campaigns/kills/run.py: which host test notices each change of the firmware.

    python -m campaigns.kills.firmware FOLDER < GROUPS.json

Each group is {"wanted": n, "changes": [[name, fields of a mutant, test that must see it], ...]}. Its changes
are tried in order until `wanted` of them compile to another code. Prints one JSON object a change.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
from pathlib import Path

import pytest

from campaigns.kills.verilog import IN_CI
from rtl.command import run_main
from sw.test import mutate

CORPUS_TEST = "sw/test/test_firmware_quality.py::test_no_input_breaks_the_firmware, by its corpus"


class FirmwareKills(mutate.HostTests):
    """A plugin of pytest: collects the host tests, then runs them in a child process for each change."""

    def __init__(self, groups: list[dict], folder: Path) -> None:
        super().__init__(mutate.MutantBuild(folder))
        self.groups = groups

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        os.environ["FIRMWARE_LIBRARIES"] = str(self.builds.folder)
        self.builds.link_libraries()
        for items in self.items.values():
            if failed := self.tests_fail(items):
                raise SystemExit(f"kills: fails on the unchanged firmware: {failed}")
        for group in self.groups:
            left = group["wanted"]
            for name, fields, seen in group["changes"]:
                if left == 0:
                    break
                verdict, by = self.noticed(mutate.Mutant(**fields), seen)
                print(json.dumps({"name": name, "verdict": verdict, "by": by}), flush=True)
                left -= verdict in ("noticed", "unnoticed")
        return True

    def noticed(self, mutant: mutate.Mutant, seen: str) -> tuple[str, str]:
        """Verdict, and the test that fails. The one that must fail runs first, then those of this kind."""
        known = {item.name: item.nodeid for items in self.items.values() for item in items}
        must = {node for node in known.values() if seen and node.startswith(seen)}
        items = self.items[mutant.file in mutate.POLL_LOOP]
        both = [item for items in self.items.values() for item in items if item.nodeid in must]
        fate = self.fate(mutant, [*both, *(item for item in items if item.nodeid not in must)])
        if fate == "survives":
            fate = mutate.replay_fails(self.builds.link_replayer)
            return ("noticed", CORPUS_TEST) if fate else ("unnoticed", "")
        if fate in mutate.NOT_COUNTED:
            return "invalid" if fate in ("does not compile", "same code") else "same", fate
        test = fate.removeprefix("test ")
        # A test that noticed one mutant often notices the next.
        items.sort(key=lambda item: item.name != test)
        return "noticed", known.get(test, f"host tests of {mutant.file}: {fate}")


def main() -> int:
    folder = Path(sys.argv[1])
    os.environ["COCOTB_RANDOM_SEED"] = mutate.SEED
    run = FirmwareKills(json.load(sys.stdin), folder)
    options = ["-q", *IN_CI, "--capture=no", "--no-header", "-p", "no:cacheprovider", "-p", "no:xdist"]
    files = [str(mutate.ROOT / test) for test in mutate.TESTS]
    code = pytest.main([*options, "-p", "no:faulthandler", *files], plugins=[run])
    shutil.rmtree(folder)
    return int(code)


if __name__ == "__main__":
    run_main("kills", main)
