# SPDX-License-Identifier: Apache-2.0
"""FC telegrams in words, from characters (FC-1 to FC-4, FC-7, FC-8).

Characters are those of capture.py, their times in any unit. Silences are in characters, so that they hold at
any rate.
"""

import functools
import operator
from typing import NamedTuple

from . import tables
from .drives import DRIVES

STX = 0x02
AROUND_DATA = 4  # STX, LGE, ADR, BCC
PROCESS, PARAMETER, AROUND_TEXT = 4, 12, 8  # bytes of data; of a text telegram without the text
LGE_MIN = PROCESS + 2
FULL_SCALE = 0x4000  # 100 %
DATA_VALID = 0x0400
AK_READ, AK_REFUSED, AK_TEXT, IND_TEXT_WRITE = 1, 7, 15, 0x05
# FC-8, in characters. The tolerance is that of the samples.
GAP_MAX = PAUSE_MIN = 2.0
TOLERANCE = 0.03
TIME_MAX = 1.5  # of the nominal time
REPLY_WITHIN = 131  # 150 ms at 9600 bit/s, the wait of the card (FC-9)

FIELDS = ("stx", "lge", "adr", "pke", "ind", "pwe", "text", "pcd1", "pcd2", "bcc-right", "bcc-wrong")
TELEGRAMS = ("request", "reply", "bad")


def width(char):
    return char.end - char.start


# ---------------------------------------------------------------- words
def word_of(data):
    return int.from_bytes(data, "big")


def signed(kind, raw):
    """A transferred value of 32 bits by the type of its parameter; of an int16 only the lower half counts."""
    bits = {"int16": 16, "int32": 32}.get(kind)
    if bits is None:
        return raw
    return (raw & (1 << bits) - 1) - (raw >> bits - 1 & 1) * (1 << bits)


def share(word):
    """Reference and output frequency in percent."""
    return 100 * signed("int16", word) / FULL_SCALE


def percent(word):
    return f"{share(word):.1f} %"


def is_broadcast(adr):
    return adr == 0x80 or adr & 0xA0 == 0x20


def latin1(data):
    """Texts are Latin-1; unprintable characters become dots."""
    return "".join(chr(code) if 0x20 <= code < 0x7F or code >= 0xA0 else "." for code in data)


def scaled(drive, pnu, raw):
    """A transferred value with decimals and unit; signed by the parameter's type."""
    if pnu not in drive["parameters"]:
        return str(raw)
    _, kind, conversion, unit = drive["parameters"][pnu]
    raw = signed(kind, raw)
    text = str(raw)
    if -6 < conversion < 0:
        text = f"{raw * 10.0**conversion:.{-conversion}f}"
    elif 0 < conversion < 6:
        text = str(raw * 10**conversion)
    return f"{text} {unit}" if unit else text


def bits_in_words(word, bits, drive):
    """The bits that say something, in words."""
    said = [(one if word >> bit & 1 else zero, only) for bit, only, zero, one in bits]
    return ", ".join(text for text, only in said if text and (only is None or only in drive["kinds"]))


class Meaning:
    """The parts of a telegram: fields as (name, first byte, byte after the last, text), and its words.

    `data` may be a cut telegram; then only whole fields are there. Lengths follow LGE, not the data.
    """

    def __init__(self, data, reply, drive):
        self.fields, self.words = [], ""
        self.fault = None  # why LGE fits no telegram
        self._data, self._reply, self._drive = data, reply, drive
        self._add("stx", 0, 1, "STX")
        if len(data) < 2:
            return
        lge = data[1]
        self._add("lge", 1, 2, f"LGE {lge}")
        if len(data) > 2:
            adr = data[2]
            number = adr & (0x7F if adr & 0x80 else 0x1F)
            who = "all" if is_broadcast(adr) else f"drive {number}"
            self._add("adr", 2, 3, f"ADR {adr:02X}h: {who}")
        inside = lge - 2
        if lge < LGE_MIN:
            self.fault = f"LGE {lge} is below {LGE_MIN}"
        elif PROCESS < inside < AROUND_TEXT:
            self.fault = f"LGE {lge} fits no kind of telegram"
        else:
            parameter = self._parameter(inside) if inside >= AROUND_TEXT else ""
            process = self._process(3 + inside - PROCESS)
            self.words = "; ".join(part for part in (parameter, process) if part)
            self._bcc(lge + 1)

    def _add(self, name, first, after, text):
        if after <= len(self._data):
            self.fields.append((name, first, after, text))

    def _parameter(self, inside):
        data, drive = self._data, self._drive
        if len(data) < 7:
            return ""
        pke, ind = word_of(data[3:5]), word_of(data[5:7])
        ak, pnu = pke >> 12, pke & drive["pnu_mask"]
        words = (tables.REPLY if self._reply else tables.REQUEST).get(ak, f"unknown AK {ak}")
        name = drive["parameters"].get(pnu, ("unknown",))[0]
        self._add("pke", 3, 5, f"PKE {pke:04X}h: AK {ak} {words}, PNU {pnu} {name}")
        self._add("ind", 5, 7, f"IND {ind:04X}h")
        what = f"{words} {pnu} {name}" + (f" [{ind & 0xFF}]" if ind & 0xFF else "")
        after = 3 + inside - PROCESS
        if ak == AK_TEXT and (self._reply or ind >> 8 == IND_TEXT_WRITE):
            text = latin1(data[7:after])
            self._add("text", 7, after, f"Text '{text}'")
            return f"{what} = '{text}'"
        if inside != PARAMETER:
            self.fault = f"LGE {data[1]} with AK {ak}"
            return what
        value = word_of(data[7:11])
        shown = scaled(drive, pnu, value)
        if self._reply and ak == AK_REFUSED:
            shown = tables.FAULT.get(value & 0xFFFF, f"fault {value & 0xFFFF}")
            what += f": {shown}"
        elif ak in (0, AK_TEXT) or (ak == AK_READ and not self._reply):
            shown = "no value"
        else:
            what += f" = {shown}"
        self._add("pwe", 7, 11, f"PWE {value:08X}h: {shown}")
        return what

    def _process(self, at):
        if len(self._data) < at + PROCESS:
            return ""
        first, second = word_of(self._data[at : at + 2]), word_of(self._data[at + 2 : at + 4])
        names = ("status", "frequency") if self._reply else ("control", "reference")
        said = bits_in_words(first, tables.STATUS if self._reply else tables.CONTROL, self._drive)
        if not self._reply and not first & DATA_VALID:
            said = "ignored: data not valid"
        word = f"{names[0]} {first:04X}h" + (f" ({said})" if said else "")
        part = f"{names[1]} {percent(second)}"
        self._add("pcd1", at, at + 2, f"PCD1 {word}")
        self._add("pcd2", at + 2, at + 4, f"PCD2 {second:04X}h: {part}")
        return f"{word}, {part}"

    def _bcc(self, at):
        if len(self._data) <= at:
            return
        bcc, right = self._data[at], functools.reduce(operator.xor, self._data[:at])
        if bcc == right:
            self._add("bcc-right", at, at + 1, f"BCC {bcc:02X}h right")
        else:
            text = f"BCC {bcc:02X}h, {right:02X}h would be right"
            self.fault = self.fault or text
            self._add("bcc-wrong", at, at + 1, text)


class Request(NamedTuple):
    """A request that waits for its reply."""

    data: bytes
    ss: float
    es: float


def same_task(request, reply, drive):
    """A reply has the kind and the parameter of its request (FC-8), as far as it goes."""
    process = bytes([PROCESS + 2])
    if process in (request[1:2], reply[1:2]):
        return request[1:2] == reply[1:2]
    return len(reply) < 5 or (word_of(request[3:5]) ^ word_of(reply[3:5])) & drive["pnu_mask"] == 0


# ---------------------------------------------------------------- telegrams on a line
class Telegrams:
    """Finds the telegrams of one line, which carries both directions, in its characters.

    `found`: name, begin, end and text of each field (of FIELDS), telegram (of TELEGRAMS) and warning.
    """

    def __init__(self, drive):
        self.drive = DRIVES[drive]
        self.found = []
        self.telegram = []  # under way
        self.outside = []  # characters outside of any telegram
        self.deaf = False  # after a bad telegram, up to the next silence (FC-8)
        self.cut = None  # last character of a telegram that ended early
        self.last = None
        self.pending = None
        self.last_end = None  # end of the last telegram

    def silence(self):
        """More than 2 characters of silence: what is not complete never will be."""
        if self.telegram:
            self.finish()
        if self.outside:
            self.end_of_outside("no-stx")
        self.deaf = False

    def character(self, char):
        if self.last and char.start - self.last.end > (GAP_MAX + TOLERANCE) * width(char):
            self.silence()
        if char.fault:
            text = f"{char.fault.capitalize()} error in {char.byte:02X}h"
            self.annotate("fault", char.start, char.end, text)
        self.last = char
        if self.telegram:
            self.telegram.append(char)
        elif char.byte == STX and not self.deaf:
            if self.outside:
                self.end_of_outside("phantom")
            self.cut = None
            if self.pending and char.start - self.pending.es > REPLY_WITHIN * width(char):
                self.no_reply()  # it can no longer begin
            self.telegram = [char]
        else:
            self.outside.append(char)
        if len(self.telegram) > 1:
            lge = self.telegram[1].byte
            if lge >= LGE_MIN and len(self.telegram) == lge + 2:
                self.finish()

    def end_of_outside(self, name):
        """Characters outside of any telegram. After one that ended early they are its rest: it had a gap."""
        chars, self.outside = self.outside, []
        shown = " ".join(f"{char.byte:02X}" for char in chars)
        text = "Phantom before STX: " if name == "phantom" else "No STX: "
        self.annotate(name, chars[0].start, chars[-1].end, text + shown)
        if name == "no-stx" and self.cut:
            gap = (chars[0].start - self.cut.end) / width(self.cut)
            text = f"Gap of {gap:.1f} characters in a telegram, at most 2"
            self.annotate("gap", self.cut.end, chars[0].start, text)
        self.cut = None

    def annotate(self, name, first, last, text):
        self.found.append((name, first, last, text))

    # ------------------------------------------------------------ a telegram
    def is_reply(self, data, ss, length):
        """By the request before. No device can know it for certain."""
        if len(data) == AROUND_DATA + PARAMETER and data[3] >> 4 == AK_REFUSED:
            return True
        asked = self.pending
        if not asked or data == asked.data or ss - asked.es > REPLY_WITHIN * length:
            return False
        return data[2:3] == asked.data[2:3] and same_task(asked.data, data, self.drive)

    def finish(self):
        """Shows a telegram that is complete, or has ended early."""
        chars, self.telegram = self.telegram, []
        data = bytes(char.byte for char in chars)
        ss, es, length = chars[0].start, chars[-1].end, width(chars[0])
        if self.last_end is not None and ss - self.last_end < (PAUSE_MIN - TOLERANCE) * length:
            pause = (ss - self.last_end) / length
            text = f"Pause of {pause:.1f} characters before a telegram, at least 2"
            self.annotate("gap", self.last_end, ss, text)
        self.last_end = es
        reply = self.is_reply(data, ss, length)
        meaning = Meaning(data, reply, self.drive)
        for name, first, after, text in meaning.fields:
            self.annotate(name, chars[first].start, chars[after - 1].end, text)
        faults = self.faults(chars, meaning)
        if faults:
            self.cut = chars[-1] if len(data) < 2 or len(data) < data[1] + 2 else None
            self.deaf = len(data) > 1 and len(data) == data[1] + 2
            self.annotate("bad", ss, es, "Bad: " + ", ".join(faults))
            return
        if reply:
            self.annotate("reply", ss, es, "Reply: " + meaning.words)
            if self.pending and not same_task(self.pending.data, data, self.drive):
                self.annotate("other-reply", ss, es, "Reply to another request")
            else:
                self.pending = None
            return
        self.no_reply()
        broadcast = is_broadcast(data[2])
        self.annotate("request", ss, es, f"{'To all' if broadcast else 'Request'}: {meaning.words}")
        self.pending = None if broadcast else Request(data, ss, es)

    def faults(self, chars, meaning):
        """Why a telegram is bad, the first reason first; none for a good one."""
        there = len(chars)
        found = [f"{char.fault} wrong in byte {at}" for at, char in enumerate(chars, 1) if char.fault]
        whole = chars[1].byte + 2 if there > 1 else 0
        if there < 2:
            found.append("cut after STX")
        elif meaning.fault:
            found.append(meaning.fault)
        elif there < whole:
            found.append(f"cut after {there} of {whole} bytes")
        took = (chars[-1].end - chars[0].start) / (there * width(chars[0]))
        if took > TIME_MAX * (1 + TOLERANCE / 10):
            found.append(f"took {took:.2f} times its nominal time, at most 1.5")
        return found

    def no_reply(self):
        if self.pending:
            self.annotate("no-reply", self.pending.ss, self.pending.es, "No reply")
            self.pending = None

    def end(self):
        """Nothing follows: shows what is not complete."""
        self.silence()
        self.no_reply()
