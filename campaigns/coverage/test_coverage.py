# SPDX-License-Identifier: Apache-2.0
"""Coverage of rtl/: merging, holes, explanations. `make coverage-rtl` is the measurement."""

from __future__ import annotations

import re

import pytest

from campaigns.coverage.run import Hole, benches, compare, count, explanations, holes, table
from rtl.sources import ROOT, bench_file, rtl_files

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
    return (
        "C '" + "".join(f"\x01{key}\x02{value}" for key, value in keys.items()) + f"\x01h\x02TOP.part' {hits}"
    )


def counts(root, block: int, taken: int, other: int) -> str:
    file = f"{root}/rtl/part.v"
    return "\n".join(
        [
            "# SystemC::Coverage-3",
            point(file, 2, "line", "block", block, "2-3"),
            point(file, 4, "branch", "if", taken, "4"),
            point(file, 4, "branch", "else", other, "5", column=2),
            point(file, 1, "toggle", "a:0->1", block),
            point(file, 1, "toggle", "a:1->0", 0),
            point(file, 6, "toggle", "state_name[7]:0->1", 0),
            point("elsewhere/core.v", 1, "line", "block", 0, "1"),
        ]
    )


@pytest.fixture
def root(tmp_path):
    (tmp_path / "rtl").mkdir()
    (tmp_path / "rtl/part.v").write_text(SOURCE)
    return tmp_path


def test_runs_add_up_and_foreign_files_do_not_count(root):
    found = count([counts(root, 1, 3, 0), counts(root, 1, 0, 2)], root)
    assert list(found) == ["rtl/part.v"]
    module = found["rtl/part.v"]
    assert module.lines == {2: 2, 3: 2, 4: 3, 5: 2}
    assert sorted(module.branches.values()) == [2, 3]
    assert "| `part` | 4 of 4 | 100.0 % | 2 of 2 | 100.0 % | 1 of 2 | 50.0 % |" in table(found)
    assert not holes(found, root)


def test_generated_verilog_of_the_card_counts(root):
    generated = point(f"{root}/regs/generated/tables.v", 1, "line", "block", 1, "1-3")
    assert count([generated], root)["regs/generated/tables.v"].lines == {1: 1, 2: 1, 3: 1}


def test_uncovered_place_is_one_hole(root):
    found = count([counts(root, 1, 3, 0)], root)
    gaps = holes(found, root)
    assert gaps == [
        Hole("rtl/part.v", 4, "if (b) c <= 1;", "else"),
        Hole("rtl/part.v", 5, "else c <= 0;", ""),
    ]


def test_holes_and_explanations_must_match():
    gap = Hole("rtl/part.v", 4, "if (b) c <= 1;", "else")
    entry = {"file": gap.file, "code": gap.code, "ways": ["else"], "why": "b is always 1"}
    assert compare([gap], [entry]) == ([], {gap: "b is always 1"})
    assert compare([gap], [])[0] == [f"not explained: {gap}"]
    assert compare([], [entry])[0] == ["explained but taken: rtl/part.v: else: if (b) c <= 1;"]
    both = {**entry, "ways": ["if", "else"]}
    assert compare([gap], [both])[0] == ["explained but taken: rtl/part.v: if: if (b) c <= 1;"]


def test_explanations_name_existing_lines():
    for entry in explanations():
        assert set(entry) == {"file", "code", "ways", "why"}, entry
        code = [line.strip() for line in (ROOT / entry["file"]).read_text().splitlines()]
        assert entry["code"] in code, entry


def test_every_module_has_its_bench_run():
    modules = [path.stem for path in rtl_files() if re.search(r"^module ", path.read_text(), re.MULTILINE)]
    own = {name: bench_file(name) for name in modules}
    # The bench of firmware_ram tests its two parts.
    assert {name for name, file in own.items() if not file} == {"ram_bank", "ram_lane"}
    assert {str(file) for file in own.values() if file} <= set(benches())
