# SPDX-License-Identifier: Apache-2.0
"""The table of what fits the small card's memory."""

import pytest

from rtl.sources import ROOT
from sw.tools import fit


@pytest.mark.nightly
@pytest.mark.rule("PERF-4")
def test_the_table_of_the_limits_is_of_this_firmware():
    assert "\n".join(fit.table()) in (ROOT / "docs/guide/dialects.md").read_text()
