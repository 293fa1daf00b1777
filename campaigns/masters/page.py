# SPDX-License-Identifier: Apache-2.0
"""The tables of build/reports/masters.md, and those of the handbook's page."""

from __future__ import annotations

from typing import Any

from campaigns.masters import faults
from campaigns.masters.cases import Case, cases
from campaigns.masters.judge import CRASH, NUMBER, TIME_OUT, how
from campaigns.masters.masters import MASTERS, Master
from campaigns.masters.session import ENDLESS
from rtl.report_page import evidence
from tb.model.card import DIALECTS

TIME_OUTS = "Their own time-outs"  # the heading
LONG = 60  # characters; a longer text is cut to its first part in the wide table
RIGHT = "✓"


def table(heads: list[str], rows: list[list[object]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    text = ["| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |" for line in lines]
    text[1] = text[1].replace(" ", "")
    return "\n".join(text)


def words(answer: dict) -> str:
    """The text of an error, set as code."""
    return f"`{answer.get('shows', answer.get('crash', '')).replace('`', chr(39))}`"


def name(results: dict, master: Master) -> str:
    found = results[master.id]
    if master.by_tcp:
        return f"{master.title}, socat {found['socat']}"
    return f"{master.title.removesuffix(' 2')} {found['version']}"


# ---------------------------------------------------------------- the one table


def short(case: Case, answer: dict) -> str:
    """A cell of the wide table."""
    if not case.is_error:
        return RIGHT
    kind = how(case, answer)
    if kind == NUMBER:
        return f"**{case.expect}**"
    text = answer.get("shows", answer.get("crash", "")).split("failed: ")[-1]
    text = text if len(text) <= LONG else text.split(":")[0]
    return {CRASH: f"crash: `{text}`", TIME_OUT: "time-out"}.get(kind, f"`{text}`")


def matrix(results: dict) -> str:
    """A row for each request and each answer of the rules; dialects with the same answer share it."""
    groups: dict[tuple[str, str], list[tuple[str, Case]]] = {}
    for dialect in DIALECTS:
        for case in cases(dialect):
            expected = str(case.expect) if case.is_error else ""
            groups.setdefault((case.id, expected), []).append((dialect, case))
    order = [case.id for case in cases("card")]
    rows = []
    for (case_id, expected), members in sorted(groups.items(), key=lambda item: order.index(item[0][0])):
        cells = []
        for master in MASTERS:
            records = results[master.id]["dialects"]
            shown = {short(case, records[dialect][case_id]["answer"]): None for dialect, case in members}
            cells.append(" / ".join(shown))
        among = "all" if len(members) == len(DIALECTS) else ", ".join(dialect for dialect, _ in members)
        rows.append([members[0][1].title, among, expected or RIGHT, *cells])
    return table(["request", "dialects", "rules", *(name(results, master) for master in MASTERS)], rows)


# ---------------------------------------------------------------- their own time-outs


def spell(seconds: float) -> str:
    return f"{1000 * seconds:.0f} ms" if seconds < 0.1 else f"{seconds:.1f} s"


def gave_up(record: dict) -> str:
    """How long a master waited for a drive that is silent, and how often it asked."""
    if record["answer"] == ENDLESS:
        return "never"
    sent = record["sent"].split()
    times = len(sent) // 8  # a request to read is 8 bytes
    seconds = spell(record["took"])
    return seconds if times == 1 else f"{seconds}, {times} requests"


def waits(own: dict, what: str) -> str:
    """The count of answers that came in time. A late one has the master's words for silence."""
    silent = own["builtin silent"][0]["answer"]
    late = sum(record["answer"] == silent for record in own[what])
    if late == 0:
        return "yes"
    return "**no**" if late == len(own[what]) else f"**{len(own[what]) - late} of {len(own[what])}**"


def exception_s(results: dict, master: Master) -> str:
    """Time to an exception that the card itself gives."""
    return spell(results[master.id]["dialects"]["card"]["address"]["took"])


def least_s(results: dict, case_id: str) -> str:
    """Shortest time that any master needed for a request in the dialect `card`."""
    return spell(min(master["dialects"]["card"][case_id]["took"] for master in results.values()))


def parity(record: dict) -> str:
    return "goes on without parity" if "values" in record else words(record)


def time_outs(results: dict) -> str:
    rows = []
    for master in MASTERS:
        found = results[master.id]
        own = found["defaults"]
        rows.append(
            [
                name(results, master),
                gave_up(own["builtin silent"][0]),
                waits(own, "card read-word"),
                waits(own, "card silent"),
                exception_s(results, master),
                "-" if master.by_tcp else parity(found["parity"]),
            ]
        )
    heads = [
        "master",
        "gives up after",
        "waits for a parameter",
        "waits for code 255",
        "code 64 takes",
        "even parity on a pty",
    ]
    return table(heads, rows)


def parts(results: dict[str, dict]) -> dict[str, Any]:
    """What the template takes, from all that each master did."""
    return {
        "system": next(iter(results.values()))["system"],
        "reading": least_s(results, "read-word"),
        "silent": least_s(results, "silent"),
        "matrix": matrix(results),
        "timeouts": time_outs(results),
    }


# ---------------------------------------------------------------- the tables of the handbook


def tables() -> dict[str, object]:
    """For tools/handbook.py: the generated blocks of docs/guide/handbook/masters.md."""
    return {"masters-time-outs": own_time_outs, "masters-faults": faults.table}


def own_time_outs() -> str:
    """The time-outs. An owner has to set one that is endless, or too short for a reading or for code 255."""
    rows = []
    for master, row in zip(MASTERS, evidence()["masters"]["tables"][TIME_OUTS][1:], strict=True):
        _, waits, reading, silent, *_ = row
        needs = waits == "never" or {reading, silent} != {"yes"}
        rows.append([master.title, waits, "yes" if needs else "no"])
    return table(["master", "by itself gives up after", "time-out must be set"], rows)
