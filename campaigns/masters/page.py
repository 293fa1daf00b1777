# SPDX-License-Identifier: Apache-2.0
"""build/reports/masters.md and the tables of the handbook's page, from answers.json."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

from campaigns.masters import faults
from campaigns.masters.cases import Case, cases
from campaigns.masters.judge import CRASH, NUMBER, TIME_OUT, how
from campaigns.masters.masters import BY_ID, HERE, MASTERS, Master
from campaigns.masters.session import ENDLESS
from tb.model.card import DIALECTS

ANSWERS = HERE / "answers.json"
TEMPLATE = HERE / "masters.md.in"
LONG = 60  # characters; a longer text is cut to its first part in the wide table
RIGHT = "✓"


class PageError(Exception):
    """Error for the user, in one line."""


@cache
def load(path: Path = ANSWERS) -> dict:
    try:
        results = json.loads(path.read_text())
    except (OSError, ValueError):
        raise PageError(f"{path.name} is no result of `make masters`") from None
    if not isinstance(results, dict) or "masters" not in results:
        raise PageError(f"{path.name} is no result of `make masters`")
    return results


def table(heads: list[str], rows: list[list[object]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    text = ["| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |" for line in lines]
    text[1] = text[1].replace(" ", "")
    return "\n".join(text)


def words(answer: dict) -> str:
    """The text of an error, set as code."""
    return f"`{answer.get('shows', answer.get('crash', '')).replace('`', chr(39))}`"


def name(results: dict, master: Master) -> str:
    if master.by_tcp:
        return f"{master.title}, socat {results['socat']}"
    return f"{master.title.removesuffix(' 2')} {results['masters'][master.id]['version']}"


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
            records = results["masters"][master.id]["dialects"]
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
    return spell(results["masters"][master.id]["dialects"]["card"]["address"]["took"])


def least_s(results: dict, case_id: str) -> str:
    """Shortest time that any master needed for a request in the dialect `card`."""
    return spell(min(master["dialects"]["card"][case_id]["took"] for master in results["masters"].values()))


def parity(record: dict) -> str:
    return "goes on without parity" if "values" in record else words(record)


def time_outs(results: dict) -> str:
    rows = []
    for master in MASTERS:
        found = results["masters"][master.id]
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


def layout(value: object, depth: int = 5) -> str:
    """JSON with a line for each dialect of a master, and one for all that it does by itself."""
    if depth == 0 or not isinstance(value, dict) or not any(isinstance(one, dict) for one in value.values()):
        return json.dumps(value, ensure_ascii=False)
    entries = [f"{json.dumps(key)}: {layout(entry, depth - 1)}" for key, entry in value.items()]
    return "{\n" + ",\n".join(entries) + "\n}"


def page(results: dict) -> str:
    return TEMPLATE.read_text().format(
        measured=f"card `{results['card']}`, firmware sources `{results['sources']}`",
        system=results["system"],
        reading=least_s(results, "read-word"),
        silent=least_s(results, "silent"),
        timeout=f"{results['timeout_s']:g}",
        matrix=matrix(results),
        timeouts=time_outs(results),
    )


# ---------------------------------------------------------------- the table of the handbook


def tables() -> dict[str, object]:
    """For tools/handbook.py: the generated blocks of docs/guide/handbook/masters.md."""
    return {"masters-time-outs": lambda: own_time_outs(load()), "masters-faults": faults.table}


def own_time_outs(results: dict) -> str:
    """The time-outs, and whether an owner has to set them."""
    rows = []
    for master in BY_ID.values():
        own = results["masters"][master.id]["defaults"]
        rows.append([master.title, gave_up(own["builtin silent"][0]), "yes" if needs(own) else "no"])
    return table(["master", "by itself gives up after", "time-out must be set"], rows)


def needs(own: dict) -> bool:
    """Too short for a reading or for code 255, or endless."""
    endless = own["builtin silent"][0]["answer"] == ENDLESS
    return endless or {waits(own, "card read-word"), waits(own, "card silent")} != {"yes"}
