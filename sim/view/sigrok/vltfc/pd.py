# SPDX-License-Identifier: Apache-2.0
"""libsigrokdecode decoder of FC telegrams, stacked on uart; fc.py does the work.

Bad input: an option outside its list raises OptionError, which ends the decoding with its text. The syntax is
that of Python 3.4, because a program may bring its own old Python along.
"""

import sigrokdecode as srd

from . import fc, tables


class OptionError(Exception):
    """An option has a value that the decoder does not know."""


class Decoder(fc.Telegrams, srd.Decoder):
    api_version = 3
    id = "vltfc"
    name = "VLT FC"
    longname = "Danfoss FC protocol"
    desc = "Telegrams between a VLT drive and its master."
    license = "apache-2.0"
    inputs = ["uart"]
    outputs = []
    tags = ["Embedded/industrial"]
    options = (
        {
            "id": "drive",
            "desc": "Names and bits of this drive",
            "default": "vlt6000",
            "values": tuple(sorted(tables.DRIVES)),
        },
        {
            "id": "requests",
            "desc": "Line of the requests",
            "default": "auto",
            "values": ("auto", "rx", "tx"),
        },
    )
    annotations = tuple((name, fc.NAMES[name]) for name in fc.CLASSES)
    annotation_rows = (
        ("fields", "Fields", tuple(range(len(fc.FIELDS)))),
        ("telegrams", "Telegrams", tuple(range(len(fc.FIELDS), len(fc.FIELDS) + len(fc.TELEGRAMS)))),
        ("warnings", "Warnings", tuple(range(len(fc.FIELDS) + len(fc.TELEGRAMS), len(fc.CLASSES)))),
    )

    def __init__(self):
        self.reset()

    def reset(self):
        self.begin(Decoder.options[0]["default"])

    def start(self):
        self.out_ann = self.register(srd.OUTPUT_ANN)
        # libsigrokdecode puts the chosen values into the instance's `options`; the class keeps its table.
        for option in Decoder.options:
            value = self.options[option["id"]]
            if value not in option["values"]:
                known = ", ".join(option["values"])
                raise OptionError("%s=%s is unknown; choose one of %s" % (option["id"], value, known))
        self.begin(self.options["drive"], self.options["requests"])

    def annotate(self, name, ss, es, *texts):
        self.put(ss, es, self.out_ann, [fc.CLASSES.index(name), list(texts)])

    def decode(self, ss, es, data):
        kind, rxtx, value = data
        line = self.lines[rxtx]
        if kind == "PARITY ERROR":
            line.flaw = "parity"
        elif kind in ("INVALID STOPBIT", "INVALID STARTBIT"):
            line.flaw = line.flaw or kind
        elif kind == "FRAME":
            flaw, line.flaw = line.flaw, None
            if flaw != "INVALID STARTBIT":  # a pulse, no character
                self.character(rxtx, fc.Character(ss, es, value[0], flaw))
        elif kind == "IDLE":
            if line.last and es - line.last.es > (fc.GAP_MAX + fc.TOLERANCE) * line.last.length:
                self.silence(rxtx)
            self.no_reply_by(es, es - ss)
