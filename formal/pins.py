# SPDX-License-Identifier: Apache-2.0
"""Checks that the assumptions of a proof leave every pin of the module free to take both values.

The twin of a `prove` task has the same files, defines and parameters. It assumes each promise and helper
instead of asserting it, and covers both values of every pin, in the second clock from any state on. A pin
that cannot move shows an assumption that is too strong; formal/unseen.toml lists the intended ones.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
UNSEEN = ROOT / "formal/unseen.toml"
PORT = re.compile(r"^    (?:input|output)\s+(?:wire|reg)\s*(?:\[[^\]]*\])?\s*(\w+),?$", re.M)
STEPS = 3  # any state, the next state, and one more
# Steps count from the first one, in which every other register may have any value.
FIRST = "state 0\nassume (= [g_step] #b00)\n"


def pins(rtl: str) -> list[str]:
    return [pin for pin in PORT.findall(re.sub(r"\s*//.*", "", rtl)) if pin != "clk"]


def values(rtl: str) -> list[str]:
    """`pin = value` for both values of each pin; for several bits: not all 0, not all 1."""
    return [f"{pin} = {value}" for pin in pins(rtl) for value in (0, 1)]


def unseen(module: str, task: str) -> set[str]:
    return set(tomllib.loads(UNSEEN.read_text()).get(module, {}).get(task, []))


def with_covers(joined: str, rtl: str) -> str:
    """The module with its properties and a cover for each value."""
    lines = ["reg [1:0] g_step;", "always @(posedge clk) g_step <= g_step + 2'd1;"]
    for value in values(rtl):
        pin, level = value.split(" = ")
        taken = f"|{pin}" if level == "1" else f"!(&{pin})"
        running = "" if pin == "rst" else " && !rst"
        # Covered one clock later, after the assumptions of this clock have been checked at its end.
        lines.append(f"reg g_{pin}_{level};\nalways @(posedge clk) g_{pin}_{level} <= {taken}{running};")
        lines.append(f"always @* l_{pin}_{level} : cover (g_step == 2'd2 && g_{pin}_{level});")
    before, _, after = joined.rpartition("\nendmodule\n")
    return before + "\n" + "\n".join(lines) + "\nendmodule\n" + after


def script(sby: str, joined: str, twin: str) -> str:
    """The .sby of the task's twin; `joined` and `twin` are the paths of the two Verilog files."""
    text = re.sub("^mode .*", "mode cover", sby, flags=re.M)
    text = re.sub("^depth .*", f"depth {STEPS}", text, flags=re.M)
    text = re.sub(r"^(smtbmc \w+)$", r"\1 -- --noinit --smtc src/first.smtc", text, flags=re.M)
    text = text.replace("\n[files]", "chformal -cover -remove c:c_*\nchformal -assert2assume\n\n[files]")
    return text.replace(joined, twin) + f"{Path(twin).parent}/first.smtc\n"


def errors(module: str, task: str, output: str, passed: bool) -> str:
    """Errors found by the twin's run; empty if every pin moves except those listed in unseen.toml."""
    stuck = {f"{pin} = {level}" for pin, level in re.findall(r"Unreached cover .*: l_(\w+)_([01])\b", output)}
    if not stuck and not passed:
        return output[-600:]
    meant = unseen(module, task)
    found = [f"the assumptions never allow {value}" for value in sorted(stuck - meant)]
    return "\n".join(found + [f"unseen.toml: the pin does reach {value}" for value in sorted(meant - stuck)])
