# SPDX-License-Identifier: Apache-2.0
"""FC telegrams in words, from characters (FC-1 to FC-4, FC-7, FC-8): for the sigrok decoder and for `rtu2fc`.

Times are in any unit, such as sample numbers. Silences are in characters, of the length that the caller
reports, so that they hold at any rate. The syntax is that of Python 3.4, because a program may bring its own
old Python along.
"""

from . import tables

STX = 0x02
AROUND_DATA = 4  # STX, LGE, ADR, BCC
PROCESS, PARAMETER, AROUND_TEXT = 4, 12, 8  # bytes of data; of a text telegram without the text
LGE_MIN = PROCESS + 2
FULL_SCALE = 0x4000  # 100 %
DATA_VALID = 0x0400
AK_READ, AK_REFUSED, AK_TEXT, IND_TEXT_WRITE = 1, 7, 15, 0x05
ALL = "To all"  # a request to the broadcast address
# FC-8, in characters. The tolerance is that of the samples.
GAP_MAX = PAUSE_MIN = 2.0
TOLERANCE = 0.03
TIME_MAX = 1.5  # of the nominal time
REPLY_WITHIN = 131  # 150 ms at 9600 bit/s, the wait of the card (FC-9)

FIELDS = ("stx", "lge", "adr", "pke", "ind", "pwe", "text", "pcd1", "pcd2", "bcc-right", "bcc-wrong")
TELEGRAMS = ("request", "reply", "bad")
WARNINGS = ("parity", "stop-bit", "gap", "phantom", "no-stx", "other-reply", "no-reply")
CLASSES = FIELDS + TELEGRAMS + WARNINGS
NAMES = {
    "stx": "STX",
    "lge": "LGE",
    "adr": "ADR",
    "pke": "PKE: AK and PNU",
    "ind": "IND",
    "pwe": "PWE",
    "text": "Text",
    "pcd1": "PCD1: control or status word",
    "pcd2": "PCD2: reference or output frequency",
    "bcc-right": "BCC right",
    "bcc-wrong": "BCC wrong",
    "request": "Request",
    "reply": "Reply",
    "bad": "Bad telegram",
    "parity": "Parity error",
    "stop-bit": "Stop bit error",
    "gap": "Gap too long or pause too short",
    "phantom": "Phantom character before STX",
    "no-stx": "Characters without STX",
    "other-reply": "Reply to another request",
    "no-reply": "No reply",
}


class Character:
    """A character on a line, with its first and last sample."""

    def __init__(self, ss, es, value, flaw):
        self.ss, self.es, self.value, self.flaw = ss, es, value, flaw

    @property
    def length(self):
        return self.es - self.ss


class Line:
    """State of one direction: the telegram under way, and the characters outside of any telegram."""

    def __init__(self):
        self.flaw = None  # of the character under way
        self.telegram = []
        self.outside = []
        self.deaf = False  # after a bad telegram, up to the next silence (FC-8)
        self.cut = None  # last character of a telegram that ended early
        self.last = None


# ---------------------------------------------------------------- words
def word_of(data):
    return int.from_bytes(data, "big")


def percent(word):
    signed = word - 0x10000 if word & 0x8000 else word
    return "%.1f %%" % (100.0 * signed / FULL_SCALE)


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
    if kind == "int32" and raw >= 0x80000000:
        raw -= 0x100000000
    elif kind == "int16":
        raw &= 0xFFFF
        raw -= 0x10000 if raw >= 0x8000 else 0
    text = str(raw)
    if -6 < conversion < 0:
        text = "%.*f" % (-conversion, raw * 10.0**conversion)
    elif 0 < conversion < 6:
        text = str(raw * 10**conversion)
    return text + " " + unit if unit else text


def bits_in_words(word, bits, drive):
    """The bits that say something, in words."""
    said = []
    for bit, only, zero, one in bits:
        text = one if word >> bit & 1 else zero
        if text and (only is None or only in drive["kinds"]):
            said.append(text)
    return ", ".join(said)


class Meaning:
    """The parts of a telegram: fields as (class, first byte, byte after the last, texts), and its words.

    `data` may be a cut telegram; then only whole fields are there. Lengths follow LGE, not the data.
    """

    def __init__(self, data, reply, drive):
        self.fields = []
        self.fault = None  # why LGE fits no telegram
        self.words = ""
        self._data, self._reply, self._drive = data, reply, drive
        self._add("stx", 0, 1, "STX")
        if len(data) < 2:
            return
        lge = data[1]
        self._add("lge", 1, 2, "LGE %d" % lge, "%d" % lge)
        self._address()
        inside = lge - 2
        if lge < LGE_MIN:
            self.fault = "LGE %d is below %d" % (lge, LGE_MIN)
            return
        if PROCESS < inside < AROUND_TEXT:
            self.fault = "LGE %d fits no kind of telegram" % lge
            return
        parameter = self._parameter(inside) if inside >= AROUND_TEXT else ""
        process = self._process(3 + inside - PROCESS)
        self.words = "; ".join(part for part in (parameter, process) if part)
        self._bcc(lge + 1)

    def _add(self, name, first, after, *texts):
        if after <= len(self._data):
            self.fields.append((name, first, after, list(texts)))

    def _address(self):
        if len(self._data) < 3:
            return
        adr = self._data[2]
        number = adr & (0x7F if adr & 0x80 else 0x1F)
        who = "all" if is_broadcast(adr) else "drive %d" % number
        self._add("adr", 2, 3, "ADR %02Xh: %s" % (adr, who), "ADR %02Xh" % adr, "%02X" % adr)

    def _parameter(self, inside):
        data, drive = self._data[3:], self._drive
        if len(data) < 4:
            return ""
        pke, ind = word_of(data[0:2]), word_of(data[2:4])
        ak, pnu = pke >> 12, pke & drive["pnu_mask"]
        words = (tables.REPLY if self._reply else tables.REQUEST).get(ak, "unknown AK %d" % ak)
        name = drive["parameters"].get(pnu, ("unknown",))[0]
        self._add("pke", 3, 5, "PKE %04Xh: AK %d %s, PNU %d %s" % (pke, ak, words, pnu, name), "PNU %d" % pnu)
        index = ind & 0xFF
        self._add("ind", 5, 7, "IND %04Xh" % ind, "%04X" % ind)
        what = "%s %d %s" % (words, pnu, name) + (" [%d]" % index if index else "")
        after = 3 + inside - PROCESS
        is_text = ak == AK_TEXT and (self._reply or ind >> 8 == IND_TEXT_WRITE)
        if is_text:
            text = latin1(self._data[7:after])
            self._add("text", 7, after, "Text '%s'" % text, text)
            return "%s = '%s'" % (what, text)
        if inside != PARAMETER:
            self.fault = "LGE %d with AK %d" % (self._data[1], ak)
            return what
        value = word_of(self._data[7:11])
        shown = scaled(drive, pnu, value)
        if self._reply and ak == AK_REFUSED:
            shown = tables.FAULT.get(value & 0xFFFF, "fault %d" % (value & 0xFFFF))
            what += ": " + shown
        elif ak in (0, AK_TEXT) or (ak == AK_READ and not self._reply):
            shown = "no value"
        else:
            what += " = " + shown
        self._add("pwe", 7, 11, "PWE %08Xh: %s" % (value, shown), "%08X" % value)
        return what

    def _process(self, at):
        if len(self._data) < at + PROCESS:
            return ""
        first, second = word_of(self._data[at : at + 2]), word_of(self._data[at + 2 : at + 4])
        if self._reply:
            names, bits = ("status", "frequency"), tables.STATUS
        else:
            names, bits = ("control", "reference"), tables.CONTROL
        said = bits_in_words(first, bits, self._drive)
        if not self._reply and not first & DATA_VALID:
            said = "ignored: data not valid"
        word = "%s %04Xh" % (names[0], first) + (" (%s)" % said if said else "")
        share = "%s %s" % (names[1], percent(second))
        self._add("pcd1", at, at + 2, "PCD1 " + word, "%04X" % first)
        self._add("pcd2", at + 2, at + 4, "PCD2 %04Xh: %s" % (second, share), share, "%04X" % second)
        return word + ", " + share

    def _bcc(self, at):
        if len(self._data) <= at:
            return
        right = 0
        for byte in self._data[:at]:
            right ^= byte
        bcc = self._data[at]
        if bcc == right:
            self._add("bcc-right", at, at + 1, "BCC %02Xh right" % bcc, "%02X" % bcc)
        else:
            text = "BCC %02Xh, %02Xh would be right" % (bcc, right)
            self.fault = self.fault or text
            self._add("bcc-wrong", at, at + 1, text, "BCC wrong", "%02X" % bcc)


class Request:
    """A request that waits for its reply."""

    def __init__(self, data, ss, es):
        self.data, self.ss, self.es = data, ss, es


def same_task(request, reply, drive):
    """A reply has the kind and the parameter of its request (FC-8), as far as it goes."""
    process = bytes([PROCESS + 2])
    if process in (request[1:2], reply[1:2]):
        return request[1:2] == reply[1:2]
    return len(reply) < 5 or (word_of(request[3:5]) ^ word_of(reply[3:5])) & drive["pnu_mask"] == 0


# ---------------------------------------------------------------- telegrams on a line
class Telegrams:
    """Finds the telegrams of one line in its characters; RX and TX may be two wires of it.

    A subclass shows annotations by `annotate(name, first, last, *texts)`, names as in CLASSES. `requests` is
    the wire of the requests: rx, tx, or auto.
    """

    def begin(self, drive, requests="auto"):
        self.drive = tables.DRIVES[drive]
        self.requests = requests
        self.lines = [Line(), Line()]  # RX, TX
        self.pending = None
        self.last_end = None  # end of the last telegram, on either line

    def silence(self, rxtx):
        """More than 2 characters of silence: what is not complete never will be."""
        line = self.lines[rxtx]
        if line.telegram:
            self.finish(rxtx)
        if line.outside:
            self.outside(line, "no-stx")
        line.deaf = False

    def character(self, rxtx, char):
        line = self.lines[rxtx]
        if line.last and char.ss - line.last.es > (GAP_MAX + TOLERANCE) * char.length:
            self.silence(rxtx)
        if char.flaw == "parity":
            self.annotate("parity", char.ss, char.es, "Parity error in %02Xh" % char.value, "Parity")
        elif char.flaw:
            self.annotate("stop-bit", char.ss, char.es, "Stop bit error in %02Xh" % char.value, "Stop bit")
        line.last = char
        if line.telegram:
            line.telegram.append(char)
        elif char.value == STX and not line.deaf:
            if line.outside:
                self.outside(line, "phantom")
            line.cut = None
            self.no_reply_by(char.ss, char.length)
            line.telegram = [char]
        else:
            line.outside.append(char)
        if len(line.telegram) > 1:
            lge = line.telegram[1].value
            if lge >= LGE_MIN and len(line.telegram) == lge + 2:
                self.finish(rxtx)

    def outside(self, line, name):
        """Characters outside of any telegram. After one that ended early they are its rest: it had a gap."""
        chars, line.outside = line.outside, []
        shown = " ".join("%02X" % char.value for char in chars)
        text = "Phantom before STX: " if name == "phantom" else "No STX: "
        self.annotate(name, chars[0].ss, chars[-1].es, text + shown, shown)
        if name == "no-stx" and line.cut:
            gap = (chars[0].ss - line.cut.es) / float(line.cut.length)
            text = "Gap of %.1f characters in a telegram, at most 2" % gap
            self.annotate("gap", line.cut.es, chars[0].ss, text, "Gap")
        line.cut = None

    # ------------------------------------------------------------ a telegram
    def is_reply(self, rxtx, data, ss, length):
        """By the option; without it, by the request before."""
        if self.requests != "auto":
            return rxtx != ("rx", "tx").index(self.requests)
        if len(data) == AROUND_DATA + PARAMETER and data[3] >> 4 == AK_REFUSED:
            return True
        asked = self.pending
        if not asked or data == asked.data or ss - asked.es > REPLY_WITHIN * length:
            return False
        return data[2:3] == asked.data[2:3] and same_task(asked.data, data, self.drive)

    def finish(self, rxtx):
        """Shows a telegram that is complete, or has ended early."""
        line = self.lines[rxtx]
        chars, line.telegram = line.telegram, []
        data = bytes(char.value & 0xFF for char in chars)
        ss, es, length = chars[0].ss, chars[-1].es, chars[0].length
        if self.last_end is not None and ss - self.last_end < (PAUSE_MIN - TOLERANCE) * length:
            pause = (ss - self.last_end) / float(length)
            text = "Pause of %.1f characters before a telegram, at least 2" % pause
            self.annotate("gap", self.last_end, ss, text, "Pause")
        self.last_end = es
        reply = self.is_reply(rxtx, data, ss, length)
        meaning = Meaning(data, reply, self.drive)
        for name, first, after, texts in meaning.fields:
            self.annotate(name, chars[first].ss, chars[after - 1].es, *texts)
        faults = self.faults(chars, meaning)
        if faults:
            line.cut = chars[-1] if len(data) < 2 or len(data) < data[1] + 2 else None
            line.deaf = len(data) > 1 and len(data) == data[1] + 2
            self.annotate("bad", ss, es, "Bad: " + ", ".join(faults), "Bad")
            return
        if reply:
            self.annotate("reply", ss, es, "Reply: " + meaning.words, "Reply")
            if self.pending and not same_task(self.pending.data, data, self.drive):
                self.annotate("other-reply", ss, es, "Reply to another request", "Other request")
            else:
                self.pending = None
            return
        self.no_reply()
        broadcast = is_broadcast(data[2])
        self.annotate("request", ss, es, (ALL if broadcast else "Request") + ": " + meaning.words, "Request")
        self.pending = None if broadcast else Request(data, ss, es)

    def faults(self, chars, meaning):
        """Why a telegram is bad, the first reason first; none for a good one."""
        there = len(chars)
        found = [
            "%s wrong in byte %d" % ("parity" if char.flaw == "parity" else "stop bit", at)
            for at, char in enumerate(chars, 1)
            if char.flaw
        ]
        whole = chars[1].value + 2 if there > 1 else 0
        if there < 2:
            found.append("cut after STX")
        elif meaning.fault:
            found.append(meaning.fault)
        elif there < whole:
            found.append("cut after %d of %d bytes" % (there, whole))
        took = (chars[-1].es - chars[0].ss) / float(there * chars[0].length)
        if took > TIME_MAX * (1 + TOLERANCE / 10):
            found.append("took %.2f times its nominal time, at most 1.5" % took)
        return found

    # ------------------------------------------------------------ requests without a reply
    def no_reply_by(self, now, length):
        """The request is given up when its reply can no longer begin."""
        late = self.pending and now - self.pending.es > REPLY_WITHIN * length
        if late and not any(line.telegram for line in self.lines):
            self.no_reply()

    def no_reply(self):
        if self.pending:
            self.annotate("no-reply", self.pending.ss, self.pending.es, "No reply", "None")
            self.pending = None

    def end(self):
        """Nothing follows: shows what is not complete."""
        for rxtx in (0, 1):
            self.silence(rxtx)
        self.no_reply()
