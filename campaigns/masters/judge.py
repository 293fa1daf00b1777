# SPDX-License-Identifier: Apache-2.0
"""Compares the answers with the rules, and says how a master showed an exception.

A value that is not the expected one fails, and so does a request or a reply with other bytes. How a master
words an exception is recorded, not judged. A number that it gives must be the code of the rules.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from campaigns.masters.cases import SILENCE, Case, cases, pdu_of, reply_of
from campaigns.masters.masters import Master
from tb.agents.crc16 import with_crc

UNIT = b"\x01"
NUMBER, WORDS, CRASH, TIME_OUT = "number", "words", "crash", "time-out"


def frame(pdu: bytes) -> str:
    return with_crc(UNIT + pdu).hex(" ")


def has_number(text: str, code: int) -> bool:
    """The code in decimal or as 0x.., as a word of its own."""
    return bool(re.search(rf"(?<![\w.]){code}(?![\w.])|0x{code:02x}(?!\w)", text, re.IGNORECASE))


def how(case: Case, answer: dict) -> str:
    """NUMBER, WORDS, CRASH or TIME_OUT for a case that ends with an error."""
    if "crash" in answer:
        return CRASH
    if case.expect == SILENCE:
        return TIME_OUT
    return NUMBER if "code" in answer or has_number(answer["shows"], case.expect) else WORDS


def faults(case: Case, record: dict) -> Iterator[str]:
    """Deviations of one request from the rules."""
    sent = frame(pdu_of(case.request))
    silent = case.expect == SILENCE
    # A master may repeat a request that nobody answers.
    times = max(1, len(record["sent"].split()) // len(sent.split())) if silent else 1
    if record["sent"] != " ".join([sent] * times):
        yield f"sent {record['sent'] or 'nothing'} instead of {sent}"
    reply = reply_of(case)
    heard = "" if reply is None else frame(reply)
    if record["heard"] != heard:
        yield f"heard {record['heard'] or 'nothing'} instead of {heard or 'nothing'}"
    for other in record.get("around", []):
        yield f"a write around it: {other}"
    answer = record["answer"]
    if not case.is_error:
        if answer != case.expect:
            yield f"{answer} instead of {case.expect}"
    elif not answer.keys() & {"shows", "crash"}:
        yield f"{answer} instead of {'an error' if silent else f'exception {case.expect}'}"
    elif "code" in answer and answer["code"] != case.expect:
        yield f"exception {answer['code']} instead of {case.expect}"


def deviations(master: Master, dialect: str, records: dict) -> list[str]:
    """Every deviation of a master in a dialect, in one line each; a case without an answer is one."""
    wrong = []
    for case in cases(dialect):
        found = faults(case, records[case.id]) if case.id in records else ["no answer"]
        wrong += [f"{master.title}, {dialect}, {case.title}: {fault}" for fault in found]
    return wrong
