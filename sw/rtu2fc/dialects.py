# SPDX-License-Identifier: Apache-2.0
"""The dialects of the card: exception codes, index register, the usual drive of each."""

from __future__ import annotations

from dataclasses import dataclass

from . import tables


@dataclass(frozen=True)
class Dialect:
    """The differences between the manuals."""

    codes: dict[str, int]  # exception code for each error; "drive" if not the fault number itself
    index_register: int
    text_by_size: bool
    drive: str
    options: tuple[str, ...] = ()  # build options that are on

    def code(self, why: str | int) -> int:
        if isinstance(why, str):
            return self.codes[why]
        return self.codes.get("drive", why)


# From regs/dialects.toml by make regs: dialects
DIALECTS = {
    "card": Dialect(
        {"function": 67, "length": 65, "quantity": 66, "address": 64, "value": 2, "silent": 255},
        index_register=0,
        text_by_size=False,
        drive="vlt6000",
        options=("STRICT_T15",),
    ),
    "builtin": Dialect(
        {"function": 67, "length": 65, "quantity": 66, "address": 64, "value": 66},
        index_register=8,
        text_by_size=True,
        drive="vlt6000",
        options=("STATUS_REFRESH", "STRICT_T15"),
    ),
    "hvac_basic": Dialect(
        {"function": 1, "length": 3, "quantity": 3, "address": 2, "value": 3, "drive": 4},
        index_register=8,
        text_by_size=True,
        drive="hvac_basic",
        options=("STATUS_REFRESH", "DIAGNOSTICS", "STRICT_T15"),
    ),
}
# end of dialects
WORDS = {
    "function": "unknown function",
    "length": "wrong length of the message",
    "quantity": "wrong quantity",
    "address": "no such coil or register, or it cannot be written",
    "value": "value refused by the card",
    "silent": "no answer from the drive",
    "drive": "refused by the drive; its display has the reason",
}


def meaning(code: int, dialect: str, of_drive: bool = False) -> str:
    """An exception in words. `of_drive`: the request was for a parameter, so that the drive may refuse it."""
    words = [WORDS[why] for why, known in DIALECTS[dialect].codes.items() if known == code]
    fault = "the drive: " + tables.FAULT[code] if code in tables.FAULT else ""
    if fault and "drive" not in DIALECTS[dialect].codes and (of_drive or not words):
        return fault
    return words[0] if words else "no code of this dialect"
