# SPDX-License-Identifier: Apache-2.0
"""The solver's proof that a mutant of the firmware is no change: right ones are proved, wrong ones never."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import pytest
import z3

from sw.test import contracts, fields, same, symbolic
from sw.test.host import BUILDS, ROOT
from tb.lib.seeds import seeded

LIMIT = ("WRITE_COIL, FORM_SINGLE, 1, coil_write", "WRITE_COIL, FORM_SINGLE, 2, coil_write")
COPIED = ("(txn->telegram_length + 3u) & ~3u", "(txn->telegram_length + 4u) & ~3u")
PROVED = [
    ("coils.c", "if (shift > 24)", "if (shift >= 24)"),
    # Of the second word no bit comes into the byte.
    ("coils.c", "if (shift > 24)", "if (shift > 16)"),
    ("translate.c", *LIMIT),
    # By its contract: it is another value, which shows the same flips.
    ("guard.c", "<< 2 ^ txn->check", "<< 1 ^ txn->check"),
    # By its contract: the compiler keeps another register.
    ("telegram.c", '        __asm__("" : "+r"(from));', "        ;"),
    # By its contract: PCD takes the place of what another step stores.
    ("telegram.c", "while (at < to)", "while (at <= to)"),
    # By its contract: the kind of a telegram that is not made.
    ("translate.c", "WRITE_COIL, FORM_SINGLE, 1, coil_write", "WRITE_COIL, FORM_SINGLE, 0, coil_write"),
    # By its contract: bytes after BCC come along.
    ("gateway.c", *COPIED),
    # By its contract: a drive's reply never has this outcome in this dialect.
    ("gateway.c", "if (TRAITS.text_by_size && g->reply_outcome", "if (g->reply_outcome"),
]
WRONG = {
    "a limit two higher": ("coils.c", "if (shift > 24)", "if (shift >= 27)"),
    "a limit one higher": ("coils.c", "if (shift > 24)", "if (shift > 25)"),
    "another number": ("coils.c", "CONTROL_COILS = 32", "CONTROL_COILS = 33"),
    "a sum with the other sign": ("guard.c", "+= *word - value", "-= *word - value"),
    "a store left out": ("reply.c", "    txn->out.reply[1] = (uint8_t)code;\n", ""),
    "a length left out": ("reply.c", "    txn->reply_length = 5;\n", ""),
    "another argument": ("telegram.c", "return end(txn, to, 0, 0);", "return end(txn, to, 0, 1);"),
    "a guard that loses a bit": ("guard.c", "<< 2 ^ txn->check", "<< 3 ^ txn->check"),
    "a guard of one word": ("guard.c", "<< 2 ^ txn->check", "<< 2"),
    "a guard of other words": ("guard.c", "<< 2 ^ txn->check", "<< 2 ^ txn->operand"),
    "a guard of the settings in effect": ("guard.c", "t->next.word[GUARD]", "t->settings.word[GUARD]"),
    "a guard that hides a bit": ("guard.c", "<< 2 ^ txn->check", "<< 2 | txn->check"),
    # It shows each flip of one of its words, but not each flip of a control word, which changes both.
    "a guard that cancels": (
        "guard.c",
        "t->next.word[GUARD] << 2 ^ txn->check",
        "(t->next.word[GUARD] << 16 | t->next.word[GUARD] >> 16) ^ txn->check",
    ),
    "a check without its history": ("telegram.c", "check += check + bcc", "check -= check + bcc"),
    "a check of the last word": ("telegram.c", "check + (from[-1] >> 3)", "from[-1]"),
    "a check with another shift": ("telegram.c", "from[-1] >> 3", "from[-1] >> 4"),
    "another BCC": ("telegram.c", "bcc ^ bcc >> 8", "bcc ^ bcc >> 9"),
    "two steps too many": ("telegram.c", "while (at < to)", "while (at < to + 5)"),
    "a row of another function": ("translate.c", "{WRITE_COIL, FORM_SINGLE, 1", "{WRITE_COIL, FORM_READ, 1"),
    "a handler of another row": ("translate.c", "1, coil_write}", "1, coils_write}"),
    "a limit of registers": (
        "translate.c",
        "FORM_SINGLE, 0, register_write",
        "FORM_SINGLE, 1, register_write",
    ),
    "a limit of the last row": ("translate.c", "FORM_READ, 128,", "FORM_READ, 127,"),
}
TWIN = "a limit two higher"  # as "a limit one higher", and as long
SLOW = (
    " row",
    "limit",
    "two steps",
    "loses a bit",
    "guard of",
    "guard that cancels",
    "guard that hides",
    "a check",
)
SLOW_FILES = ("translate.c", "telegram.c", "gateway.c")
COPY, AGAIN = COPIED[0], "TRAITS.text_by_size && g->reply_outcome == OUTCOME_EXCHANGE"
TURN = "        if (PLACES > 1)\n            g->next = (uint8_t)other(g->next);\n    } else"
ROW = "{WRITE_COIL, FORM_SINGLE, 1, coil_write}"
# Changes in functions with a contract: build, file, code, changed code.
AGAINST_CONTRACTS = {
    "a copy that is short": ("card", "gateway.c", COPY, "(txn->telegram_length + 2u) & ~3u"),
    "a copy beyond the place": ("card", "gateway.c", COPY, "(txn->telegram_length + 6u) & ~3u"),
    "a copy of everything but the end": ("card", "gateway.c", COPY, "txn->telegram_length & ~3u | 4u"),
    "a copy one place further": (
        "card",
        "gateway.c",
        "mailbox_frame(TELEGRAM_FRAME) + length",
        "mailbox_frame(TELEGRAM_FRAME) + length + 1",
    ),
    "a copy of other bytes": (
        "card",
        "gateway.c",
        "out.telegram.byte + length",
        "out.telegram.byte + length - 1",
    ),
    "a copy with two bytes exchanged": ("card", "gateway.c", "byte = byte3", "byte = byte2"),
    "a copy that leaves out the address": ("card", "gateway.c", "        frame[0].byte = byte0;\n", ""),
    "a copy from the other end": (
        "card",
        "gateway.c",
        "        frame[3].byte = byte3;\n        frame[2].byte = byte2;\n",
        "        frame[2].byte = byte2;\n        frame[3].byte = byte3;\n",
    ),
    "a second telegram after a reply": ("card", "gateway.c", AGAIN, "g->reply_outcome == OUTCOME_REPLY"),
    "a second telegram after anything": ("card", "gateway.c", AGAIN, "g->reply_outcome <= OUTCOME_EXCHANGE"),
    "a second telegram of a dialect": ("builtin", "gateway.c", AGAIN, "g->reply_outcome == OUTCOME_SILENT"),
    "a place that is none": (
        "PLACES",
        "gateway.c",
        TURN,
        "        g->next = (uint8_t)(g->next == 0);\n    } else",
    ),
    "another field for the place": (
        "PLACES",
        "gateway.c",
        TURN,
        "        g->ticket = (uint8_t)other(g->next);\n    } else",
    ),
    "a place that is kept": ("card", "gateway.c", TURN, "    } else"),
    "a coil with a byte count": ("card", "translate.c", ROW, "{WRITE_COIL, FORM_COUNTED, 0, coil_write}"),
    "a coil for a register": ("card", "translate.c", ROW, "{WRITE_COIL, FORM_SINGLE, 0, register_write}"),
}


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the firmware's sources."""
    folder = tmp_path_factory.mktemp("tree")
    shutil.copytree(ROOT / "sw", folder / "sw", ignore=shutil.ignore_patterns("corpus"))
    shutil.copytree(ROOT / "regs/generated", folder / "regs/generated")
    return folder


@pytest.fixture
def one_build(monkeypatch: pytest.MonkeyPatch) -> None:
    """One build and two lengths of a telegram. A proof needs all, and a reason against it needs one."""
    monkeypatch.setattr(same, "BUILDS", {"card": BUILDS["card"]})
    monkeypatch.setattr(contracts, "LENGTHS", [1, 9])


def why_not(tree: Path, tmp_path: Path, file: str, before: str, after: str) -> str:
    path = tree / "sw/src" / file
    text = (ROOT / "sw/src" / file).read_text()
    assert text.count(before) == 1
    path.write_text(text.replace(before, after))
    try:
        return same.why_not_same(tree, [f"sw/src/{file}"], tmp_path)
    finally:
        path.write_text(text)


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [pytest.param(*row, id=row[2], marks=[pytest.mark.nightly] * (row[0] in SLOW_FILES)) for row in PROVED],
)
@pytest.mark.usefixtures("one_build")
def test_a_mutant_without_an_effect_is_proved(tree: Path, tmp_path: Path, file: str, before: str, after: str):
    assert why_not(tree, tmp_path, file, before, after) == ""


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(
            name,
            marks=[pytest.mark.nightly] * any(word in name for word in SLOW)
            + [pytest.mark.nightly] * (name == TWIN),
        )
        for name in WRONG
    ],
)
@pytest.mark.usefixtures("one_build")
def test_a_change_of_the_firmware_is_never_proved(tree: Path, tmp_path: Path, change: str):
    reason = why_not(tree, tmp_path, *WRONG[change])
    print(reason)
    assert reason


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(
            name, marks=[pytest.mark.nightly] * any(word in name for word in ("coil", "place", "second"))
        )
        for name in AGAINST_CONTRACTS
    ],
)
def test_a_contract_lets_no_other_behaviour_pass(tree: Path, tmp_path: Path, change: str):
    build, file, before, after = AGAINST_CONTRACTS[change]
    way = same.WAYS[file == "translate.c"]
    source = fields.Originals(build, way, tmp_path)
    changed = changed_sections(tree, tmp_path, build, way, file, before, after)
    with pytest.raises(symbolic.NotProved) as refused:
        same.prove_object(source(f"sw/src/{file}"), changed, source)
    print(refused.value)


def changed_sections(
    tree: Path, tmp_path: Path, build: str, way: tuple[str, ...], file: str, *change: str
) -> dict[str, symbolic.Section]:
    path = tree / "sw/src" / file
    text = (ROOT / "sw/src" / file).read_text()
    assert text.count(change[0]) == 1
    path.write_text(text.replace(*change))
    try:
        return symbolic.compiled(tree, f"sw/src/{file}", build, way, tmp_path / "changed.o")
    finally:
        path.write_text(text)


@pytest.mark.nightly
def test_another_place_of_the_only_one_is_proved(tree: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(same, "BUILDS", {"PLACES": BUILDS["PLACES"]})
    assert why_not(tree, tmp_path, "gateway.c", TURN, TURN.replace("> 1", "> 0")) == ""


# ---------------------------------------------------------------- facts about fields


@pytest.mark.parametrize(
    ("build", "field", "most", "holds"),
    [
        ("card", fields.REPLY_OUTCOME, 2, True),
        ("card", fields.REPLY_OUTCOME, 1, False),
        ("builtin", fields.REPLY_OUTCOME, 2, False),  # it asks for a text then
        ("PLACES", fields.NEXT, 0, True),
        ("card", fields.NEXT, 0, False),
    ],
)
def test_a_bound_of_a_field_is_proved_only_where_it_holds(
    tmp_path: Path, build: str, field: fields.Field, most: int, holds: bool
):
    source = fields.Originals(build, same.WAYS[0], tmp_path)
    if holds:
        fields.never_exceeds(source, field, most)
    else:
        with pytest.raises(symbolic.NotProved):
            fields.never_exceeds(source, field, most)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("    g->drive_online = false;\n", "    g->drive_online = false;\n    g->reply_outcome = 3;\n"),
        ("    g->drive_online = false;\n", "    g->drive_online = false;\n    g->reply_outcome++;\n"),
        ("    gateway_init(g);\n", "    gateway_init(g);\n    g->reply_outcome = 3;\n"),
        ("    poll_events();\n", "    poll_events();\n    leds_init((struct leds *)&g->reply_outcome, 3);\n"),
    ],
)
def test_another_use_of_a_field_refuses_its_bound(
    tree: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, before: str, after: str
):
    file = "main.c" if "gateway_init" in before else "gateway.c"
    path = tree / "sw/src" / file
    text = (ROOT / "sw/src" / file).read_text()
    assert text.count(before) == 1
    monkeypatch.setattr(fields, "ROOT", tree)
    monkeypatch.setattr(fields, "_kept", {})
    path.write_text(text.replace(before, after))
    try:
        with pytest.raises(symbolic.NotProved) as refused:
            fields.never_exceeds(fields.Originals("card", same.WAYS[0], tmp_path), fields.REPLY_OUTCOME, 2)
    finally:
        path.write_text(text)
    print(refused.value)


@pytest.mark.parametrize("build", ["card", "builtin", "hvac_basic"])
def test_who_reads_the_kind_of_a_telegram(tmp_path: Path, build: str):
    source = fields.Originals(build, same.WAYS[0], tmp_path)
    readers = {section.name for _, section, loads, _ in fields.users(source, fields.EXPECTS) if loads}
    assert readers <= {f".text.{name}" for name in contracts.READERS}
    assert len(readers) >= 3


def test_every_build_counts(tree: Path, tmp_path: Path):
    reason = why_not(tree, tmp_path, "coils.c", "telegram_process(txn, 0)", "telegram_process(txn, 1)")
    assert reason.startswith("sw/src/coils.c STATUS_REFRESH: coils_read: an argument of telegram_process")


# ---------------------------------------------------------------- small functions

HEAD = """
#include <stdint.h>
uint32_t ask(uint32_t a);
void tell(uint32_t a, uint32_t b);
extern uint32_t shared;
"""
ALIKE = {
    "another sum": ("uint32_t f(uint32_t a){return a + a;}", "uint32_t f(uint32_t a){return a << 1;}"),
    "another comparison": (
        "uint32_t f(uint32_t a, uint32_t b){return a < b ? 1u : 7u;}",
        "uint32_t f(uint32_t a, uint32_t b){return b >= a + 1u && a + 1u ? 1u : 7u;}",
    ),
    "a signed shift": (
        "int32_t f(int32_t a){return a >> 31;}",
        "int32_t f(int32_t a){return a < 0 ? -1 : 0;}",
    ),
    "a call that is shared": (
        "uint32_t f(uint32_t a){return a ? ask(a) : ask(0);}",
        "uint32_t f(uint32_t a){return ask(a);}",
    ),
    "a loop": (
        "void f(uint8_t *a, uint32_t n){uint32_t i; for (i = 0; i < n; i++) a[i] = (uint8_t)(i << 1);}",
        "void f(uint8_t *a, uint32_t n){uint32_t i; for (i = 0; i < n; i++) a[i] = (uint8_t)(i + i);}",
    ),
    "a column that nobody reads": (
        "static const uint8_t t[][2] = {{1, 2}, {3, 4}};"
        "uint32_t f(uint32_t a){return a == t[0][0] ? 5 : a == t[1][0] ? 6 : 7;}",
        "static const uint8_t t[][2] = {{1, 2}, {3, 9}};"
        "uint32_t f(uint32_t a){return a == t[0][0] ? 5 : a == t[1][0] ? 6 : 7;}",
    ),
}
LOOP = "void f(uint8_t *a, uint32_t n){uint32_t i; for (i = 0; i < n; i++) a[i] = 1;}"
TABLE = "static const uint8_t t[8] = {1, 2, 3, 4, 5, 6, 7, 8};"
DIFFERENT = {
    "one off": ("uint32_t f(uint32_t a){return a > 24;}", "uint32_t f(uint32_t a){return a >= 24;}"),
    "one value of all": (
        "uint32_t f(uint32_t a){return a;}",
        "uint32_t f(uint32_t a){return a == 77 ? 0 : a;}",
    ),
    "signed for unsigned": (
        "uint32_t f(uint32_t a, uint32_t b){return a < b;}",
        "uint32_t f(uint32_t a, uint32_t b){return (int32_t)a < (int32_t)b;}",
    ),
    "the other shift": (
        "int32_t f(int32_t a){return a >> 3;}",
        "int32_t f(int32_t a){return (uint32_t)a >> 3;}",
    ),
    "two stores the other way round": (
        "void f(uint32_t *a, uint32_t *b){*a = 1; *b = 2;}",
        "void f(uint32_t *a, uint32_t *b){*b = 2; *a = 1;}",
    ),
    "stores of the same bytes the other way round": (
        "void f(uint32_t *a, uint8_t *b){*a = 0x01010101u; *b = 1;}",
        "void f(uint32_t *a, uint8_t *b){*b = 1; *a = 0x01010101u;}",
    ),
    "a store left out": (
        "void f(uint32_t *a){a[0] = 1; a[1] = 2;}",
        "void f(uint32_t *a){a[0] = 1;}",
    ),
    "a store of one byte": ("void f(uint32_t *a){*a = 1;}", "void f(uint8_t *a){*a = 1;}"),
    "a store at another place": ("void f(uint8_t *a){a[1] = 1;}", "void f(uint8_t *a){a[2] = 1;}"),
    "a variable of all files": ("void f(void){shared = 1;}", "void f(void){shared = 2;}"),
    "a call left out": ("void f(uint32_t a){tell(a, 1); tell(a, 2);}", "void f(uint32_t a){tell(a, 2);}"),
    "two calls the other way round": (
        "void f(void){tell(1, 1); ask(2);}",
        "void f(void){ask(2); tell(1, 1);}",
    ),
    "the second argument": ("void f(uint32_t a){tell(a, 1);}", "void f(uint32_t a){tell(a, 2);}"),
    "a store on the other side of a call": (
        "void f(void){shared = 1; ask(2);}",
        "void f(void){ask(2); shared = 1;}",
    ),
    "a value of before a call": (
        "uint32_t f(void){ask(1); return shared;}",
        "uint32_t f(void){uint32_t a = shared; ask(1); return a;}",
    ),
    "another function": (
        "uint32_t g(uint32_t a){return ask(a);} uint32_t f(void){return ask(1);}",
        "uint32_t g(uint32_t a){return ask(a);} uint32_t f(void){return g(2);}",
    ),
    "a callee": (
        "static uint32_t g(uint32_t a){return a + 1;} uint32_t f(uint32_t a){return g(a);}",
        "static uint32_t g(uint32_t a){return a + 2;} uint32_t f(uint32_t a){return g(a);}",
    ),
    "a round more": (LOOP, LOOP.replace("i < n", "i <= n")),
    "a round less": (LOOP, LOOP.replace("i = 0", "i = 1")),
    "a loop that writes another value": (LOOP, LOOP.replace("= 1;", "= (uint8_t)i;")),
    "a loop that never ends": (LOOP, LOOP.replace("i < n", "1")),
    "a constant": (
        TABLE + "uint32_t f(void){return t[3];}",
        TABLE.replace("4", "9") + "uint32_t f(void){return t[3];}",
    ),
    "a table read at any place": (
        TABLE + "uint32_t f(uint32_t a){return t[a & 7];}",
        TABLE.replace("4", "9") + "uint32_t f(uint32_t a){return t[a & 7];}",
    ),
    "a table that is passed on": (
        TABLE + "void f(void){tell((uint32_t)t, 1);}",
        TABLE.replace("4", "9") + "void f(void){tell((uint32_t)t, 1);}",
    ),
    "a table that is stored": (
        TABLE + "void f(uint32_t *a){*a = (uint32_t)t;}",
        TABLE.replace("4", "9") + "void f(uint32_t *a){*a = (uint32_t)t;}",
    ),
    "a table of all files": (
        "extern const uint8_t t[2]; const uint8_t t[2] = {1, 2}; uint32_t f(void){return t[0];}",
        "extern const uint8_t t[2]; const uint8_t t[2] = {1, 3}; uint32_t f(void){return t[0];}",
    ),
    "a variable's first value": (
        "static uint32_t v = 1; uint32_t f(void){return v++;}",
        "static uint32_t v = 2; uint32_t f(void){return v++;}",
    ),
    "a variable's size": (
        "uint8_t v[4]; uint32_t f(void){return v[0];}",
        "uint8_t v[5]; uint32_t f(void){return v[0];}",
    ),
    "a function that is missing": ("void f(void){} void g(void){}", "void f(void){}"),
    "a local variable that is passed on": (
        "uint32_t f(void){uint32_t v[2] = {1, 2}; tell((uint32_t)v, 0); return 0;}",
        "uint32_t f(void){uint32_t v[2] = {1, 3}; tell((uint32_t)v, 0); return 0;}",
    ),
}


def why_small_differ(tmp_path: Path, one: str, other: str) -> str:
    """Empty if the two are proved alike in any way of compiling them."""
    reasons = []
    for way in same.WAYS:
        sides = []
        for code in (one, other):
            (tmp_path / "f.c").write_text(HEAD + code)
            sides.append(symbolic.compiled(tmp_path, "f.c", "card", way, tmp_path / "f.o"))
        try:
            same.prove_object(*sides)
            return ""
        except symbolic.NotProved as error:
            reasons.append(str(error))
    print("; ".join(reasons))
    return reasons[0]


@pytest.mark.parametrize("change", ALIKE)
def test_the_same_in_other_words_is_proved(tmp_path: Path, change: str):
    assert why_small_differ(tmp_path, *ALIKE[change]) == ""
    assert why_small_differ(tmp_path, *reversed(ALIKE[change])) == ""


@pytest.mark.parametrize("change", DIFFERENT)
def test_another_behaviour_is_never_proved(tmp_path: Path, change: str):
    assert why_small_differ(tmp_path, *DIFFERENT[change])
    assert why_small_differ(tmp_path, *reversed(DIFFERENT[change]))


def test_a_solver_without_an_answer_proves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(symbolic.Limit, "answer", lambda *terms: z3.unknown)
    assert why_small_differ(tmp_path, *ALIKE["another comparison"])


def test_a_source_that_does_not_compile_is_not_proved(tree: Path, tmp_path: Path):
    assert why_not(tree, tmp_path, "reply.c", "return OUTCOME_REPLY;\n}\n\nenum outcome reply_fault", "}}")


# ---------------------------------------------------------------- the machine

SUMS = [
    *("a + b", "a - b", "a ^ b", "a | b", "a & b", "a << (b & 31)", "a >> (b & 31)", "~a", "-a"),
    *("(uint32_t)((int32_t)a >> (b & 31))", "(int32_t)a < (int32_t)b", "a < b", "a <= b", "a == b", "!a"),
    *("(int32_t)a < -5", "a < 5", "(uint8_t)a", "(uint16_t)b", "(uint32_t)(int8_t)a", "(uint32_t)(int16_t)b"),
    *(
        "a ^ 0x7FFu",
        "a & ~0x800u",
        "a | 0x55u",
        "a >> 7",
        "a << 3",
        "(uint32_t)((int32_t)a >> 9)",
        "0xFEDC8765u - a",
    ),
    "(int32_t)a >= (int32_t)b ? (a >= b ? 1 : 2) : (a != b ? b : 4)",
    "put(a, b)",
    "sum(a & 7, b)",
]
HELPERS = """
#include <stdint.h>
static uint32_t put(uint32_t a, uint32_t b)
{
    volatile union {
        uint8_t byte[8];
        int8_t sbyte[8];
        uint16_t half[4];
        int16_t shalf[4];
        uint32_t word[2];
    } m;
    m.word[0] = a;
    m.half[2] = (uint16_t)b;
    m.byte[6] = (uint8_t)a;
    m.byte[7] = 0x80;
    m.byte[1] = (uint8_t)b;
    return m.word[1] + (uint32_t)m.sbyte[3] + m.half[0] + (uint32_t)m.shalf[1] - m.byte[2]
        + (uint32_t)m.sbyte[7];
}
static uint32_t sum(uint32_t n, uint32_t b)
{
    uint32_t s = b;
    while (n--)
        s = s + s + (s >> 31) + n;
    return s;
}
"""


def test_the_machine_computes_as_the_host_does(tmp_path: Path):
    functions = "".join(
        f"uint32_t f{i}(uint32_t a, uint32_t b)\n{{ return {code}; }}\n" for i, code in enumerate(SUMS)
    )
    (tmp_path / "f.c").write_text(HELPERS + functions)
    command = ["gcc", "-O1", "-fwrapv", "-fPIC", "-shared", "-o", tmp_path / "f.so", tmp_path / "f.c"]
    subprocess.run(command, check=True)
    host = ctypes.CDLL(str(tmp_path / "f.so"))
    code = symbolic.compiled(tmp_path, "f.c", "card", same.WAYS[1], tmp_path / "f.o")
    rng = seeded("symbolic machine against the host")
    edges = [0, 1, 5, 31, 0x7F, 0x80, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFB, 0xFFFFFFFF]
    for _ in range(10):
        values = [rng.choice([rng.choice(edges), rng.getrandbits(32)]) for _ in range(2)]
        for i, text in enumerate(SUMS):
            right = getattr(host, f"f{i}")(*map(ctypes.c_uint32, values)) & 0xFFFFFFFF
            (state,) = contracts.returns(code, f"f{i}", symbolic.Limit(set()), *map(symbolic.word, values))
            assert z3.simplify(state.regs[10]).as_long() == right, (text, values)
