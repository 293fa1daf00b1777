# SPDX-License-Identifier: Apache-2.0
"""Telegrams of Danfoss' FC protocol, as the card and a VLT exchange them.

Stack it on uart, set to the line's rate and even parity. A wire with both directions is channel RX. Two wires
are RX and TX; the option `requests` names the one with the requests. Without that name a telegram is a reply
when it follows a request to the same address within 150 ms at 9600 bit/s and is no copy of it.

Rows: the fields of each telegram, one line a telegram, and warnings. A character that is no part of a
telegram is phantom when STX follows within 2 characters.

Licence: this folder is Apache-2.0. libsigrokdecode, which loads it, is GPLv3 or later. A program under GPLv3
may contain parts under Apache-2.0. The combination is then under GPLv3, and this folder stays Apache-2.0.
"""

from .pd import Decoder

__all__ = ["Decoder"]
