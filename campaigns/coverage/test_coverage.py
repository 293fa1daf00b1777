# SPDX-License-Identifier: Apache-2.0
"""Coverage of rtl/: merging, holes, explanations. `make coverage-rtl` is the measurement."""

from __future__ import annotations

import pytest

from campaigns.coverage.run import Hole, compare, count, explanations, holes, table
from rtl.sources import ROOT

SOURCE = """module part;
  always @(posedge clk) begin
    a <= 1;
    if (b) c <= 1;
    else c <= 0;
  end
endmodule
"""


def point(file: str, line: int, kind: str, what: str, hits: int, lines: str = "", column: int = 1) -> str:
    keys = {"f": file, "l": line, "n": column, "t": kind, "page": f"v_{kind}/part", "o": what}
    keys |= {"S": lines} if lines else {}
    text = "".join(f"\x01{key}\x02{value}" for key, value in keys.items())
    return f"C '{text}\x01h\x02TOP.part' {hits}"


def counts(root, taken: int, other: int) -> str:
    file = f"{root}/rtl/part.v"
    return "\n".join(
        [
            "# SystemC::Coverage-3",
            point(file, 2, "line", "block", 1, "2-3"),
            point(file, 4, "branch", "if", taken, "4"),
            point(file, 4, "branch", "else", other, "5", column=2),
            point(file, 1, "toggle", "a:0->1", 1),
            point(file, 1, "toggle", "a:1->0", 0),
            point(f"{root}/regs/generated/tables.v", 1, "line", "block", 1, "1-3"),
            point("elsewhere/core.v", 1, "line", "block", 0, "1"),
        ]
    )


@pytest.fixture
def root(tmp_path):
    (tmp_path / "rtl").mkdir()
    (tmp_path / "rtl/part.v").write_text(SOURCE)
    return tmp_path


def test_runs_add_up_and_only_foreign_files_do_not_count(root):
    found = count([counts(root, 3, 0), counts(root, 0, 2)], root)
    assert list(found) == ["rtl/part.v", "regs/generated/tables.v"]
    assert found["rtl/part.v"].lines == {2: 2, 3: 2, 4: 3, 5: 2}
    assert sorted(found["rtl/part.v"].branches.values()) == [2, 3]
    assert "| `part` | 4 of 4 | 100.0 % | 2 of 2 | 100.0 % | 1 of 2 | 50.0 % |" in table(found)


def test_an_uncovered_place_is_one_hole_and_needs_its_explanation(root):
    found = count([counts(root, 3, 0)], root)
    del found["regs/generated/tables.v"]
    gap, other = holes(found, root)
    assert gap == Hole("rtl/part.v", 4, "if (b) c <= 1;", "else")
    assert other == Hole("rtl/part.v", 5, "else c <= 0;", "")
    entry = {"file": gap.file, "code": gap.code, "ways": ["else"], "why": "b is always 1"}
    assert compare([gap], [entry]) == ([], {gap: "b is always 1"})
    assert compare([gap], [])[0] == [f"not explained: {gap}"]
    assert compare([], [entry])[0] == ["explained but taken: rtl/part.v: else: if (b) c <= 1;"]


def test_explanations_name_existing_lines():
    for entry in explanations():
        assert set(entry) == {"file", "code", "ways", "why"}, entry
        code = [line.strip() for line in (ROOT / entry["file"]).read_text().splitlines()]
        assert entry["code"] in code, entry
