# SPDX-License-Identifier: Apache-2.0
"""The bugs of tb/planted.toml: each one applies, and its test is there."""

from __future__ import annotations

from rtl.sources import ROOT
from tb.lib.planted import bugs
from tb.lib.rows import each_row


@each_row("bug", bugs())
def test_every_bug_applies(bug):
    assert bug.planted() != (ROOT / bug.file).read_text()
    assert bug.rules and bug.what
    assert bug.seen and bug.seen.keys() <= {"test", "fuzz", "libfuzzer", "proof"}
    file, _, test = bug.seen.get("test", "").partition("::")
    test = test.partition("[")[0]
    assert not test or f"def {test}(" in (ROOT / file).read_text(), test
