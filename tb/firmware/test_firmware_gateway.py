# SPDX-License-Identifier: Apache-2.0
"""The poll loop of the firmware with a simulated mailbox. Bytes are hex, times in ms."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import pairwise

import pytest

from regs.generated.mailbox import REGISTERS
from sw.tools.stack import reserved
from tb.lib.rows import each_row
from tb.model.firmware import Build

H = bytes.fromhex
STATUS = "0F03 2000"
READ_514 = H("03 1413 0002")
ASK_514 = H("81 1202 0000 0000 0000 0000 0000")
TELL_514 = H(f"1202 0000 0000 012C {STATUS}")
REPLY_514 = H("01 03 04 0000 012C")
READ_IND, REPLY_IND = H("03 0000 0001"), H("01 03 02 0000")
NETWORK_RED, NETWORK_GREEN, DRIVE_RED, DRIVE_GREEN = 1, 2, 4, 8
# A wait ends so many ms late: the tick under way, and one for a long round of the firmware before it.
OVERDUE_MS = 2


class Bench:
    """Gateway, mailbox and the steps of a scenario; the firmware polls after every event."""

    def __init__(self, build: Build = Build(), address: int = 1) -> None:  # noqa: B008
        self.build = build
        self.mailbox = build.mailbox(address)
        self.gateway = build.start(self.mailbox)

    def fresh(self) -> Bench:
        return type(self)(self.build)

    def restart(self) -> None:
        self.mailbox.restart()
        self.gateway = self.build.start(self.mailbox)

    def poll(self) -> None:
        self.wait(0)

    def offer(self, pdu: bytes, broadcast: bool = False) -> None:
        """A request until it is a candidate."""
        self.mailbox.candidate(pdu, broadcast)
        self.poll()

    def commit(self) -> None:
        self.mailbox.commit()
        self.poll()

    def character(self) -> None:
        self.mailbox.character()
        self.poll()

    def request(self, pdu: bytes, broadcast: bool = False) -> None:
        self.offer(pdu, broadcast)
        self.commit()

    def telegram_ends(self) -> None:
        self.mailbox.telegram_ends()
        self.poll()

    def drive(self, data: bytes, good: bool = True) -> None:
        """A whole telegram of the drive."""
        self.mailbox.drive_data(data)
        self.poll()
        self.mailbox.bcc(good)
        self.poll()

    def wait(self, ms: int) -> None:
        """Two rounds a millisecond: the exchange sees the time that the round before has read."""
        self.gateway.run(ms, rounds=2)
        assert not self.mailbox.halted

    def ask_drive(self, pdu: bytes, broadcast: bool = False) -> None:
        """A request whose telegram leaves at once."""
        self.request(pdu, broadcast)
        self.telegram_ends()

    def drive_answers(self, data: bytes, good: bool = True) -> None:
        self.telegram_ends()
        self.drive(data, good)

    def exchange(self, pdu: bytes, data: bytes, good: bool = True) -> None:
        self.request(pdu)
        self.drive_answers(data, good)

    def drive_is_silent(self, times: int = 1) -> None:
        for _ in range(times):
            self.telegram_ends()
            self.wait(150 + OVERDUE_MS)

    def before_write(self, register: str, happens: Callable[[], None]) -> None:
        """Something happens once, right before the firmware writes the register."""

        def late(**fields: int) -> None:
            self.mailbox.writes.clear()
            happens()
            self.mailbox.write_register(register, **fields)

        self.mailbox.writes[register] = late

    def sees(self, register: str, bits: int) -> None:
        """The firmware reads the register with these bits set."""
        self.mailbox.reads[register] = lambda: self.mailbox.read_register(register) | bits

    def local(self, pdu: bytes) -> None:
        """A local request; checks that the card answers at once."""
        before = len(self.replies)
        self.request(pdu)
        assert len(self.replies) == before + 1

    @property
    def replies(self) -> list[bytes]:
        return self.mailbox.replies

    @property
    def telegrams(self) -> list[bytes]:
        return self.mailbox.telegrams


HOST, CARD = Build(), Build(on_card=True)


@pytest.fixture(params=[HOST, CARD], ids=["host", "card"])
def bench(request: pytest.FixtureRequest) -> Bench:
    """The same sources: for the host, and the standard card's image on an RV32I machine."""
    return Bench(request.param)


@pytest.fixture
def delayed() -> Bench:
    return Bench(Build(option="REPLY_DELAY"))


on_the_host = pytest.mark.parametrize("bench", [HOST], ids=["host"], indirect=True)


SCENARIOS = """
FRAME-6, PERF-1: a local reply is queued at t15 and sent at t35
    offer READ_IND; is reply_queued; replied; +commit; replied REPLY_IND
FRAME-6, PERF-2: a telegram is queued at t15 and sent at t35
    offer READ_514; is telegram_queued; sent; +commit; sent ASK_514
FRAME-6: candidate and commit in one round are served
    +candidate 06_0000_0102; +commit; poll; local READ_IND; replied 01_06_0000_0102 01_03_02_0102
FRAME-6, FRAME-7: a committed write stays when its reply is dropped
    +candidate 06_0000_0102; +commit; +character; poll; local READ_IND; replied 01_03_02_0102
PERF-3, FC-6: the reply is queued before the bcc and sent with it
    ask READ_514; +data TELL_514; poll; is reply_queued; replied; +bcc; replied REPLY_514; poll;
    local 01_0020_0010; replied-last 01_01_02_03_0F
FC-8, FC-6: data and bcc in one round are answered
    ask READ_514; +data TELL_514; +bcc; poll; replied REPLY_514
FC-8, FC-6: after a wrong bcc the next good telegram is answered
    exchange-bad READ_514 1202_0000_0000_0001_FFFF_FFFF; replied; drive TELL_514; replied REPLY_514;
    local 01_0020_0020; replied-last 01_01_04_03_0F_00_20
FC-8: each exchange checks its own telegram
    request READ_514; +ends; +data TELL_514; poll; +bcc; poll; replied REPLY_514;
    request READ_514; +ends; +data 1202_0000_0000_0002_0F03_2000; poll; +bcc; poll;
    replied-last 01_03_04_0000_0002
FC-8: a good telegram that does not fit is ignored
    ask READ_514; drive STATUS x3; is listening; drive 1203_0000_0000_0001_0F03_2000; is listening;
    drive 0202_0000_0000_0001_0F03_2000; is listening; replied; drive TELL_514; replied REPLY_514
EXC, FC-4, FC-6: a refusal is passed on and updates the status
    exchange 06_040F_003C 7068_0000_0000_0011_0607_1234; replied 01_86_11; local 01_0020_0020;
    replied-last 01_01_04_0706_3412
FC-9, EXC: a silent drive gets one repeat then the master gets 255
    request READ_514; wait 500; sent ASK_514; ends; wait 150; sent-count 1; wait 2; sent ASK_514 ASK_514;
    count DRIVE_REPEAT 1; wait 20; ends; wait 150; replied; wait 2; replied 01_83_FF;
    count DRIVE_NO_REPLY 1; count EXCEPTIONS 0; wait 1000; sent-count 2; replied-count 1
FC-9: the clock may wrap during the wait
    set time 65500; restart; ask READ_514; wait 150; sent-count 1; wait 2; sent-count 2
FC-9: the repeat may still be answered
    ask READ_514; wait 152; ends; wait 100; drive TELL_514; replied REPLY_514; count DRIVE_NO_REPLY 0
FC-9: the wait extends for a bcc in progress
    ask READ_514; wait 150; +data TELL_514; wait 3; +bcc; poll; replied REPLY_514; sent-count 1
FC-9, FRAME-7: a reply after the last wait is ignored
    request READ_514; silent 2; not listening; drive TELL_514; replied 01_83_FF;
    exchange READ_514 TELL_514; replied 01_83_FF REPLY_514
MAP-3, FC-9: the control image keeps an unconfirmed write
    request 05_0006_FF00; silent 2; local 01_0000_0008; replied 01_85_FF 01_01_01_40
FRAME-7: a local request is answered while the drive works on an older one
    ask READ_514; local READ_IND; drive TELL_514; replied REPLY_IND; local 01_0020_0010;
    replied-last 01_01_02_03_0F; request READ_514; sent ASK_514 ASK_514
FRAME-7: an old drive reply does not touch a newer reply that waits
    ask READ_514; offer READ_IND; drive TELL_514; commit; replied REPLY_IND
FRAME-7, FC-8: an old wrong bcc does not touch a newer reply that waits
    ask READ_514; +data TELL_514; poll; offer READ_IND; +bcc-bad; poll; commit; replied REPLY_IND
FRAME-7, FC-9: an old time out does not touch a newer reply that waits
    ask READ_514; wait 152; ends; offer READ_IND; wait 152; commit; replied REPLY_IND
FRAME-7: a ticket that wraps does not release the old reply
    ask READ_514; local READ_IND x15; offer READ_IND; drive TELL_514; commit; replied REPLY_IND*16
FRAME-7: a newer request for the drive waits for the older exchange
    ask READ_514; request 05_0006_FF00; sent ASK_514; drive TELL_514; sent ASK_514 81_0040_0000;
    answers STATUS; replied 01_05_0006_FF00
FRAME-7, FRAME-6: a revoked waiting request is dropped
    ask READ_514; offer 05_0006_FF00; character; drive TELL_514; wait 500; sent ASK_514;
    local 01_0000_0008; replied 01_01_01_00
FRAME-7, FRAME-6: a waiting candidate is sent only after its commit
    ask READ_514; offer 05_0006_FF00; drive TELL_514; sent ASK_514; commit; sent ASK_514 81_0040_0000
FRAME-7, MAP-3, SAFE-8: two writes of coils that wait become one telegram with the newest image
    ask READ_514; request 05_0006_FF00; request 05_0001_FF00; drive TELL_514; sent ASK_514 81_0042_0000;
    answers STATUS; replied 01_05_0001_FF00; wait 400; sent-count 2
FRAME-7, FC-9: a write that waited is answered and repeated like any other
    ask READ_514; request START; drive TELL_514; silent;
    sent-from 1 US:TELEGRAM_OF_START US:TELEGRAM_OF_START; answers STATUS; replied 01_0F_0000_0020
FC-9: a late stop ends a long wait at once
    local 06_0002_03E8; ask READ_514; wait 5000; request STOP; wait 2; sent ASK_514 US:TELEGRAM_OF_STOP
FC-9, MAP-5: a local request does not shorten the wait
    local 06_0002_03E8; ask READ_514; local READ_IND; wait 9000; drive TELL_514; local 01_0020_0010;
    replied-last 01_01_02_03_0F
WDG-1, FRAME-7: a write after a restart waits for the telegram on the line
    request START; restart; request STOP; sent US:TELEGRAM_OF_START; ends; wait 10;
    sent-from 1 US:TELEGRAM_OF_STOP; answers STATUS; replied 01_0F_0000_0020
FRAME-7, FC-9: no older telegram is repeated after a newer request
    ask READ_514; request 05_0006_FF00; wait 152; sent ASK_514 81_0040_0000; replied
FRAME-7, FC-8, SAFE-8: a write of coils that waits for its pause leaves with the newest image
    wait 100; busy; request 05_0006_FF00; request 05_0001_FF00; sent; +free; poll; sent 81_0042_0000;
    answers STATUS; sent-count 1; replied 01_05_0001_FF00
MAP-9, FC-9: a broadcast exchange ends with its telegram
    request-all 05_0006_FF00; sent 80_0040_0000; is no_reply; request READ_514; sent-count 1; ends;
    sent-from 1 ASK_514; answers TELL_514; replied REPLY_514; wait 500; sent-count 2
MAP-9: a broadcast to local registers is executed without a reply
    request-all 06_0000_0102; request-all 03_0000_0001; replied; local READ_IND; replied 01_03_02_0102
LED-1, BOOT-1: requests are answered during the show
    wait 300; local READ_IND
LED-3, MAP-5: network led is green while good frames come often enough
    wait 3000; lit NETWORK_RED; local 06_0001_012C; lit NETWORK_GREEN; wait 1900; local READ_IND;
    wait 1900; lit NETWORK_GREEN; wait 200; lit NETWORK_RED
LED-3, MAP-5: network led turns red exactly at the time out
    wait 2100; local 06_0001_012C; wait 2999; shows NETWORK_GREEN DRIVE_RED; wait 1;
    shows NETWORK_RED DRIVE_RED
LED-3, MAP-5: network time out 0 means never
    local 06_0001_0000; wait 20000; lit NETWORK_GREEN
LED-3, FRAME-6: a revoked or foreign frame does not turn the network led green
    wait 3000; offer READ_IND; character; event foreign; poll; lit NETWORK_RED
LED-4, FC-9: drive led is green again when the repeat is answered
    wait 3000; request READ_514; silent 2; lit DRIVE_RED; ask READ_514; wait 152; answers TELL_514;
    lit DRIVE_GREEN
LED-4: drive led shows the result of the last exchange
    wait 3000; lit DRIVE_RED; ask 06_040F_003C; drive 7068_0000_0000_0011_0F03_2000; lit DRIVE_GREEN;
    request READ_514; silent 2; lit DRIVE_RED; request-all 05_0006_FF00; ends; lit DRIVE_RED
FC-8, FC-9, LED-4: a telegram that cannot be sent is abandoned after the wait
    busy; request READ_514; wait 150; replied; wait 4; replied 01_83_FF; count DRIVE_NO_REPLY 1; +free;
    wait 500; sent; request READ_514; sent ASK_514
FRAME-7, FC-9: a line that is never silent holds a parameter write, which leaves after its 255
    busy; request SET_207; wait 160; replied 01_86_FF; wait 400; sent; +free; poll; sent US:TELEGRAM_OF_207;
    answers TELL_207; wait 400; sent-count 1; replied-count 1
FRAME-7, SAFE-8: two changes of the image on a busy line, one of them for all, are told to this drive
    busy; request-FIRST START; request-OTHER STOP; +free; poll; sent US:TELEGRAM_OF_STOP
FRAME-6, FRAME-7: a stop that waits leaves although a later frame is revoked
    ask READ_514; request STOP; +candidate 05_0001_FF00; +character; poll; drive TELL_514; wait 5;
    sent ASK_514 US:TELEGRAM_OF_STOP
EXC, FRAME-7: a line that was busy for an older write brings no answer to what gets none
    busy; request SET_207; request 81_00; wait 400; replied
FC-9: a request just before the end of an older telegram's wait has a wait of its own
    busy; request SET_207; wait 145; request READ_514; wait 10; replied; wait 155; replied 01_83_FF
FRAME-7: only a newer write of its kind takes the place of a parameter write after its 255
    busy; request SET_207; request-all SET_207; wait 320; request SET_207_AGAIN; +free; poll;
    sent ALL:TELEGRAM_OF_207; ends; poll; sent-from 1 US:TELEGRAM_OF_207_AGAIN; answers TELL_207; wait 400;
    sent-count 2
FRAME-7, SAFE-8, MAP-3: an image that could not leave in time leaves as soon as the line is free
    busy; request START; wait 400; replied 01_8F_FF; +free; poll; sent US:TELEGRAM_OF_START; answers STATUS;
    wait 400; sent-count 1; replied-count 1
FRAME-6, FC-9: a candidate does not prolong the wait of an older telegram
    busy; request READ_514; wait 140; offer READ_IND; wait 20; character; +free; wait 20; sent
FRAME-7, FC-9: a write that waited for an exchange waits for the line anew
    ask READ_514; wait 100; request-all START; busy; drive TELL_514; wait 100; +free; poll;
    sent ASK_514 ALL:TELEGRAM_OF_START
FRAME-6, FC-9: a slow commit does not count as a wait for the drive line
    # At 300 bit/s a candidate waits 73 ms for its commit; register 40003 may be 10 ms.
    local 06_0002_0001; offer READ_514; wait 73; commit; sent ASK_514
FRAME-6, FC-9: the wait for a busy drive line begins at the commit
    local 06_0002_0005; busy; offer READ_514; wait 73; commit; wait 40; +free; sent ASK_514
FC-8, MAP-9: a broadcast telegram is sent after the pause
    busy; request-all 0F_0000_0020_04_3C040000; wait 2; request READ_IND; +free; poll; sent 80_043C_0000
FRAME-6: a revoked request changes nothing and sends nothing
    offer 06_0000_0102; character; offer 05_0040_FF00; character; offer 05_000A_FF00; character;
    local READ_IND; local 01_0000_0041; replied REPLY_IND 01_01_09_000000_000000_000000; sent;
    count DRIVE_NO_REPLY 0; request READ_514; sent ASK_514
FRAME-6, WDG-1: a request from before a restart is not served again
    request 05_000A_FF00; +ends; restart; poll; sent 81_0400_0000; local 01_0000_0010;
    replied-last 01_01_02_0000
FC-9: every silent exchange has its own repeat
    request READ_514; sent-count 1; silent; sent-count 2; silent; replied 01_83_FF;
    request READ_514; sent-count 3; silent; sent-count 4; silent; replied 01_83_FF*2
FC-9: misfits do not extend the wait
    ask READ_514; wait 50; drive STATUS; wait 50; drive STATUS; wait 50; drive STATUS; sent-count 1; wait 2;
    ends; wait 50; drive STATUS; wait 50; drive STATUS; wait 50; drive STATUS; sent-count 2; wait 2;
    replied 01_83_FF
FRAME-7, SAFE-1: an unsent start never follows a newer stop
    # The model of the whole card allows it 6 ms to give way (OVERTAKEN_MS).
    busy; request START; wait 60; request STOP; wait 6; +free; poll; sent 81_043C_0000;
    answers 0607_0000; wait 400; sent 81_043C_0000; replied 01_0F_0000_0020
FRAME-7, MAP-9: a newer write takes the place of an older one
    ask READ_514; request-FIRST START; request-FIRST STOP; drive TELL_514; answers STATUS; wait 400;
    sent ASK_514 FIRST:TELEGRAM_OF_STOP
FRAME-7, MAP-9: a committed write waits whatever comes after it
    ask READ_514; request-FIRST START; offer-FIRST STOP; character; request 03_1409_0002; local READ_IND;
    request 07; sent ASK_514; drive TELL_514; sent ASK_514 FIRST:TELEGRAM_OF_START
FRAME-7, MAP-9: a write of a parameter waits like one of coils
    ask READ_514; request-FIRST SET_207; request READ_IND; drive TELL_514; replied REPLY_IND;
    sent ASK_514 FIRST:TELEGRAM_OF_207; answers TELL_207; replied REPLY_IND
FRAME-7, MAP-9: a parameter write that replaces another is the last to leave
    # The place is the older one's, its turn is not: writes leave in the order of their commits.
    ask READ_514; request-FIRST SET_207; request-OTHER SET_207; request-FIRST SET_207_AGAIN; drive TELL_514;
    answers TELL_207; sent ASK_514 OTHER:TELEGRAM_OF_207 FIRST:TELEGRAM_OF_207_AGAIN
FRAME-7, MAP-9: parameter writes that wait leave in the order of commit
    ask READ_514; request-FIRST SET_207; request-OTHER SET_207; request READ_514; drive TELL_514;
    answers TELL_207 x2; answers TELL_514; replied REPLY_514;
    sent ASK_514 FIRST:TELEGRAM_OF_207 OTHER:TELEGRAM_OF_207 ASK_514
FRAME-7, SAFE-8: a stop waits behind a reading and leaves before a newer parameter write
    exchange START STATUS; ask READ_514; request STOP; request-FIRST SET_207; drive TELL_514;
    sent-from 2 US:TELEGRAM_OF_STOP; answers STATUS; sent-from 3 FIRST:TELEGRAM_OF_207
FRAME-7, SAFE-8: a stop waits behind a reading and leaves before an older parameter write
    exchange START STATUS; ask READ_514; request-FIRST SET_207; request STOP; drive TELL_514;
    sent-from 2 US:TELEGRAM_OF_STOP; answers STATUS; sent-from 3 FIRST:TELEGRAM_OF_207
FRAME-7, SAFE-8: after a write to all that waits one to the own drive goes there
    ask READ_514; request-all START; request STOP; drive TELL_514; answers STATUS; wait 400;
    sent ASK_514 US:TELEGRAM_OF_STOP; replied 01_0F_0000_0020
FRAME-7, SAFE-8: after a write to the own drive that waits one to all goes to the own drive
    ask READ_514; request START; request-all STOP; drive TELL_514; answers STATUS; wait 400;
    sent ASK_514 US:TELEGRAM_OF_STOP; replied
FRAME-7, SAFE-8: a write to all that a busy line held up goes to all
    busy; request-all START; wait 170; sent; +free; poll; sent ALL:TELEGRAM_OF_START; ends; wait 400;
    sent-count 1
FRAME-7, SAFE-8: after a write that has left one to the other unit goes where it says
    request-FIRST START; request-OTHER STOP; answers STATUS;
    sent FIRST:TELEGRAM_OF_START OTHER:TELEGRAM_OF_STOP
FRAME-7, MAP-9: a parameter write behind a reading is displaced by no other request
    ask READ_514; request SET_207; request READ_514; local READ_IND; offer SET_207_AGAIN; character;
    request START; request-all SET_207_AGAIN; drive TELL_514; answers STATUS; answers TELL_207;
    sent ASK_514 US:TELEGRAM_OF_START US:TELEGRAM_OF_207 ALL:TELEGRAM_OF_207_AGAIN
FRAME-7, MAP-9: a parameter write on a busy line is displaced by no other request
    busy; request SET_207; wait 5; request READ_514; local READ_IND; offer SET_207_AGAIN; character;
    request START; request-all SET_207_AGAIN; +free; poll; answers STATUS; answers TELL_207;
    sent US:TELEGRAM_OF_START US:TELEGRAM_OF_207 ALL:TELEGRAM_OF_207_AGAIN
FRAME-7: a parameter write behind a reading is displaced by no candidate
    ask READ_514; request SET_207; offer SET_207_AGAIN; drive TELL_514; character;
    sent ASK_514 US:TELEGRAM_OF_207
FRAME-7: a parameter write on a busy line is displaced by no candidate
    busy; request SET_207; wait 5; offer SET_207_AGAIN; wait 5; +free; poll; character;
    sent US:TELEGRAM_OF_207
FRAME-7, SAFE-1: a write of coils on a busy line keeps its place against other requests
    busy; request START; wait 60; local READ_IND; request READ_514; offer READ_IND; character; wait 60; +free;
    poll; sent US:TELEGRAM_OF_START
FRAME-7, FC-9: a write that waited is repeated even after a newer request
    ask READ_514; request START; drive TELL_514; ends; local READ_IND; wait 152;
    sent ASK_514 US:TELEGRAM_OF_START*2; replied REPLY_IND
FC-9, MAP-5: a write that waits never lengthens the wait
    local 06_0002_0005; ask READ_514; request-FIRST STOP; wait 50; sent ASK_514; wait 2;
    sent ASK_514 FIRST:TELEGRAM_OF_STOP
FRAME-7, FC-9: a revoked write does not shorten the wait for the drive
    local 06_0002_03E8; ask READ_514; wait 1000; offer STOP; wait 5; character; wait 5; drive TELL_514;
    local 01_0020_0010; replied-last 01_01_02_03_0F; sent ASK_514
FRAME-3, LED-4: a revoked telegram is no fault of the drive
    wait 3000; exchange READ_514 TELL_514; offer READ_514; wait 5; character; wait 200; busy; offer START;
    wait 5; character; wait 200; offer SET_207; wait 5; character; wait 200; sent ASK_514; replied REPLY_514;
    count DRIVE_NO_REPLY 0; lit DRIVE_GREEN
FC-9: a parameter write older than a command takes nothing of its repeat
    ask READ_514; request SET_207; request START; drive TELL_514; silent 2;
    sent ASK_514 US:TELEGRAM_OF_START*2 US:TELEGRAM_OF_207; replied 01_8F_FF
FC-9: a parameter write older than a command does not shorten its wait
    local 06_0002_0014; ask READ_514; request SET_207; request START; drive TELL_514; ends; wait 195;
    sent ASK_514 US:TELEGRAM_OF_START; wait 7; sent-count 3
FC-9: a parameter write newer than a command takes its repeat
    ask READ_514; request START; request SET_207; drive TELL_514; silent;
    sent ASK_514 US:TELEGRAM_OF_START US:TELEGRAM_OF_207
FC-9: a parameter write that came after a command left takes its repeat
    ask START; request SET_207; wait 152; sent US:TELEGRAM_OF_START US:TELEGRAM_OF_207
FC-9: of two parameter writes that waited the newer takes the repeat
    ask READ_514; request SET_207; request-all SET_207; request START; drive TELL_514; answers STATUS; silent;
    sent ASK_514 US:TELEGRAM_OF_START US:TELEGRAM_OF_207 ALL:TELEGRAM_OF_207
FC-9: a command during a parameter write is newer than the one that still waits
    ask READ_514; request SET_207; request-all SET_207; drive TELL_514; request START; silent 3;
    sent ASK_514 US:TELEGRAM_OF_207 US:TELEGRAM_OF_START*2 ALL:TELEGRAM_OF_207
FC-9: a request for the card alone takes no repeat from a parameter write
    ask SET_207; local READ_IND; wait 152; sent US:TELEGRAM_OF_207*2
FC-9: a write for the card alone takes no repeat from a parameter write
    ask SET_207; local 06_0000_0102; wait 154; sent US:TELEGRAM_OF_207*2; silent; wait 400; sent-count 2
FC-9: coil 65 takes no repeat from a command
    ask START; local 05_0040_FF00; wait 154; sent US:TELEGRAM_OF_START*2; silent; wait 400; sent-count 2
FC-9: a write for the card alone takes no repeat that waits for a free line
    ask SET_207; busy; wait 152; local 06_0000_0102; wait 5; sent-count 1; +free; poll;
    sent US:TELEGRAM_OF_207*2
FC-9, FRAME-6: a candidate does not turn an old repeat into a newer command
    ask START; busy; wait 152; offer 05_0040_FF00; commit; offer STOP; +commit; +free; poll;
    sent US:TELEGRAM_OF_START US:TELEGRAM_OF_STOP
FC-9: a repeat that waits for a free line gives way to a newer telegram
    ask SET_207; busy; wait 152; request SET_207_AGAIN; +free; poll;
    sent US:TELEGRAM_OF_207 US:TELEGRAM_OF_207_AGAIN
FC-9: a repeat that waits for a free line gives way to a newer reading
    ask SET_207; busy; wait 152; request READ_514; +free; poll; sent US:TELEGRAM_OF_207 ASK_514
FC-9: a repeat that waits for a free line gives way to a newer write to all
    ask SET_207; busy; wait 152; request-all SET_207; +free; poll;
    sent US:TELEGRAM_OF_207 ALL:TELEGRAM_OF_207
FC-9: a stop that waits shortens a wait of 160 ms to 150
    local 06_0002_0010; ask READ_514; request STOP; wait 152; sent ASK_514 US:TELEGRAM_OF_STOP
MAP-10: without the option nothing is counted for diagnostics
    ask-all START; exchange READ_514 TELL_514; exchange 06_040F_003C 7068_0000_0000_0011_0F03_2000;
    request 07; replied REPLY_514 01_86_11 01_87_43; count COMPLETED 0; count EXCEPTIONS 0
WDG-1: counters survive a restart and count during the loop-back test
    event crc; poll; set loopback 1; restart; event crc; poll; count CRC 2
SAFE-7: without the option no stop is sent, nor does one that is due prevent a repeat
    local 06_0001_0008; exchange START STATUS; due; wait 500; request READ_514; silent 2;
    sent US:TELEGRAM_OF_START ASK_514*2
"""
DELAY_SCENARIOS = """
LINE-9: a reply leaves after the delay
    request READ_IND; wait 20; replied; wait 2; replied REPLY_IND; wait 400; replied-count 1
LINE-9, FRAME-7: a character during the delay drops the reply
    request READ_IND; wait 15; character; wait 400; replied; request READ_IND; wait 22; replied REPLY_IND
LINE-9, FRAME-7: a frame during the delay that is revoked drops the reply
    request READ_IND; wait 15; character; offer 03_0001_0001; character; wait 400; replied;
    request READ_IND; wait 22; replied REPLY_IND
LINE-9, FRAME-7: a newer request does not get the reply that is held
    request READ_IND; wait 15; request READ_514; wait 22; replied
LINE-9: the reply to a short exchange leaves after the delay
    request READ_514; wait 5; ends; +data TELL_514; poll; replied; +bcc; poll; replied; wait 20;
    replied REPLY_514
LINE-9: the reply to an exchange longer than the delay leaves with the bcc
    request READ_514; wait 30; ends; +data TELL_514; poll; replied; +bcc; poll; replied REPLY_514
LINE-9, FRAME-7: an old wrong bcc does not touch a newer reply that is held
    ask READ_514; +data TELL_514; poll; request READ_IND; +bcc-bad; wait 22; replied REPLY_IND
LINE-9, FC-8: a wrong bcc during the delay sends nothing
    ask READ_514; drive-bad 1202_0000_0000_0001_FFFF_FFFF; wait 22; replied; drive TELL_514;
    replied REPLY_514
"""
STOP_SCENARIOS = """
SAFE-7: the stop is sent once after the time
    wait 80; sent SEND_START; wait 5; sent SEND_START SEND_STOP; answers STATUS; replied-count 2; wait 1000;
    sent SEND_START SEND_STOP; replied-count 2; local READ_CONTROL; replied-last 01_01_02_3C04
SAFE-7: the stop keeps every other bit of the control word
    exchange 0F_0000_0010_02_FFFF STATUS; wait 85; sent-from 2 81_FFBF_1999
SAFE-7: the stop commands a drive whose last write left bit 10 clear
    exchange 0F_0000_0010_02_7800 STATUS; wait 85; sent-from 2 81_0438_1999
SAFE-7: the stop goes to the own drive after broadcasts
    # A broadcast goes to all drives; the stop must not inherit its address.
    ask-all START; wait 5; ask-all START; wait 5; sent-from 1 ALL:TELEGRAM_OF_START*2; wait 85;
    sent-from 3 SEND_STOP
SAFE-7, FRAME-7: writes that wait leave after the stop, and a reading gets 255
    # Each transaction is in use: at the drive, both waiting writes, the reading.
    ask START; request-all SET_207; request SET_207; request READ_514; wait 160; replied-last 01_83_FF;
    sent SEND_START*2 SEND_STOP; answers STATUS; sent-from 3 ALL:TELEGRAM_OF_207; ends;
    sent-from 4 US:TELEGRAM_OF_207; answers TELL_207; sent-count 5
SAFE-7, SAFE-8: a write after the stop merges into the image that shows it
    wait 85; answers STATUS; request 05_0001_FF00; sent SEND_START SEND_STOP 81_043E_1999
SAFE-7, SAFE-8: a start that could not leave before the loss leaves no more
    busy; request 05_0001_FF00; wait 85; sent SEND_START; replied-last 01_85_FF; +free; poll;
    sent SEND_START 81_043E_1999; ends;
    wait 160; sent-from 1 81_043E_1999*2; answers STATUS; wait 1000; sent-count 3; local READ_CONTROL;
    replied-last 01_01_02_3E04
SAFE-7: nor does a start that waits behind an exchange, or was for all
    request READ_514; request-all 05_0001_FF00; wait 85; answers TELL_514;
    sent SEND_START ASK_514 81_043E_1999; ends; wait 160; sent-from 2 81_043E_1999*2; answers STATUS;
    exchange READ_514 TELL_514; replied-last REPLY_514; sent-count 5
SAFE-7, EXC: a reading that the stop takes back gets 255, and the stop keeps its repeat
    busy; request READ_514; wait 75; replied-count 2; wait 10; replied-last 01_83_FF; sent SEND_START; +free;
    poll; sent SEND_START SEND_STOP; count DRIVE_NO_REPLY 0; ends; wait 160; sent-from 1 SEND_STOP*2;
    answers STATUS; exchange READ_514 TELL_514; replied-last REPLY_514
SAFE-7, FRAME-7: nothing else that waits for the line leaves before the stop
    busy; request SET_207; wait 85; +free; poll; sent SEND_START SEND_STOP; answers STATUS;
    sent-from 2 US:TELEGRAM_OF_207
SAFE-7: a candidate that commits prevents the stop
    wait 75; offer READ_IND; wait 20; sent SEND_START; commit; wait 20; sent SEND_START
SAFE-7: a candidate that is revoked delays the stop
    wait 75; offer READ_IND; wait 20; sent SEND_START; character; wait 20; sent SEND_START SEND_STOP
SAFE-7: while a candidate decides no start leaves after the time
    busy; request 05_0001_FF00; wait 75; offer READ_IND; wait 20; +free; poll; sent SEND_START; character;
    wait 20; sent SEND_START 81_043E_1999
SAFE-7: with the commit of a candidate a start that was taken back leaves
    busy; request 05_0001_FF00; wait 75; offer READ_IND; wait 20; +free; poll; sent SEND_START; commit;
    wait 5; sent SEND_START 81_047E_1999
SAFE-7: a drive that was stopped gets no stop
    request 0F_0000_0010_02_3C04; answers STATUS; wait 1000; sent SEND_START SEND_STOP
SAFE-7: a drive that was stopped gets no stop whatever its other bits
    exchange 0F_0000_0010_02_BFFF STATUS; due; wait 1000; sent-count 2
SAFE-7: the gate's clock alone sends no stop
    set limit 3; wait 78; sent SEND_START
SAFE-7: the firmware's clock alone sends no stop
    set limit 0x80000; wait 2000; sent SEND_START
SAFE-7, FC-9: the firmware's clock alone prevents no repeat
    request READ_514; set limit 0x80000; ends; wait 160; sent SEND_START ASK_514*2
SAFE-7, FC-9: the stop is repeated once
    wait 85; ends; wait 160; ends; wait 1000; sent SEND_START SEND_STOP SEND_STOP
SAFE-7, SAFE-8: a stop that a busy line held up leaves when the line is free
    busy; wait 600; sent SEND_START; +free; poll; sent SEND_START SEND_STOP
SAFE-7, FC-9: the stop is newer than a write that waits, and keeps its repeat
    local 06_0002_0020; ask READ_514; request SET_207; wait 100; drive TELL_514; sent-from 2 SEND_STOP;
    ends; wait 400; sent-from 2 SEND_STOP*2
SAFE-7, FC-9: the stop is newer than a reading that waits, and keeps its repeat
    local 06_0002_0020; ask READ_514; request 03_1409_0002; wait 100; replied-count 3; drive TELL_514;
    replied-last 01_83_FF; sent-from 2 SEND_STOP; ends; wait 400; sent-from 2 SEND_STOP*2
SAFE-7, FC-9: the stop ends the wait for a dead drive
    local 06_0002_03E8; ask READ_514; wait 140; sent-count 2; wait 20; sent SEND_START ASK_514 SEND_STOP
"""


def scenarios(table: str) -> list:
    """Rules and name of a scenario, a line of reasons after #, and its steps.

    With FIRST in the steps it is played twice: FIRST is all drives and OTHER the own one, then exchanged.
    """
    found = []
    for row in re.split(r"\n(?=\S)", table.strip()):
        head, *lines = row.split("\n")
        rules, name = head.split(": ", 1)
        steps = " ".join(line.strip() for line in lines if not line.strip().startswith("#"))
        marks = pytest.mark.rule(*rules.split(", "))
        if "FIRST" not in steps:
            found.append(pytest.param(steps, id=name, marks=marks))
            continue
        for first, other in (("all", "us"), ("us", "all")):
            units = steps.replace("FIRST", first).replace("OTHER", other)
            found.append(pytest.param(units, id=f"{name}, {first} first", marks=marks))
    return found


def play(bench: Bench, steps: str, names: dict[str, object]) -> None:
    """Plays the steps of a scenario. A frame is a name, or hex with _ between; *n repeats it.

    request, offer, ask, exchange, drive, answers, silent, wait, local: the methods of Bench. `-all` makes a
    broadcast, `-bad` a wrong BCC. A + says that the firmware has no round after the event. sent, replied:
    all that left, or of it the last one, the number, or those from a number on.
    """
    mailbox, names = bench.mailbox, globals() | names

    def frames(words: list[str]) -> list[bytes]:
        found = []
        for word in words:
            unit, _, rest = word.rpartition(":")
            name, _, times = rest.partition("*")
            value = names.get(name, name.replace("_", " "))
            value = H(value) if isinstance(value, str) else value
            found += [to(unit.lower(), value) if unit else value] * int(times or 1)
        return found

    for step in steps.split(";"):
        verb, *words = step.split()
        times = int(words.pop()[1:]) if words and re.fullmatch(r"x\d+", words[-1]) else 1
        verb, _, how = verb.partition("-")
        left = {"sent": lambda: bench.telegrams, "replied": lambda: bench.replies}.get(verb)
        for _ in range(times):
            if left and how == "count":
                assert len(left()) == int(words[0]), step
            elif left and how == "from":
                assert left()[int(words[0]) :] == frames(words[1:]), step
            elif left:
                assert (left()[-1:] if how else left()) == frames(words), step
            elif verb in ("is", "not"):
                assert bool(getattr(mailbox, words[0])) == (verb == "is"), step
            elif verb == "count":
                assert mailbox.counter(f"COUNT_{words[0]}") == int(words[1]), step
            elif verb == "lit":
                network = words[0].startswith("NETWORK")
                led = NETWORK_RED | NETWORK_GREEN if network else DRIVE_RED | DRIVE_GREEN
                assert lit(bench) & led == names[words[0]], step
            elif verb in ("wait", "silent"):
                getattr(bench, {"silent": "drive_is_silent"}.get(verb, verb))(int((words or ["1"])[0]))
            elif verb == "shows":
                assert mailbox.led == sum(names[word] for word in words), step
            elif verb == "set":
                setattr(mailbox, words[0], int(words[1], 0))
            elif verb == "due":
                bench.sees("EXCHANGE", STOP_DUE)
            elif verb == "busy":
                mailbox.quiet = False
            elif verb == "event":
                mailbox.event(words[0])
            elif verb[0] == "+":
                event = {"data": "drive_data", "free": "pause_over", "ends": "telegram_ends"}
                getattr(mailbox, event.get(verb[1:], verb[1:]))(*frames(words), *[False] * (how == "bad"))
            else:
                method = {"ask": "ask_drive", "answers": "drive_answers", "ends": "telegram_ends"}.get(
                    verb, verb
                )
                arguments = {"all": {"broadcast": True}, "bad": {"good": False}}.get(how, {})
                getattr(bench, method)(*frames(words), **arguments)


@pytest.mark.parametrize("steps", scenarios(SCENARIOS))
def test_scenario(bench: Bench, steps: str):
    play(bench, steps, globals())


@pytest.mark.parametrize("steps", scenarios(DELAY_SCENARIOS))
def test_scenario_of_a_delayed_reply(delayed: Bench, steps: str):
    play(delayed, steps, globals())


@pytest.mark.parametrize("steps", scenarios(STOP_SCENARIOS))
def test_scenario_of_a_lost_master(running: Bench, steps: str):
    play(running, steps, globals())


# ---------------------------------------------------------------- prepare early, commit late


@pytest.mark.rule("FRAME-6", "SAFE-1")
@each_row("reads", [1, 2, 3])
def test_a_newer_candidate_is_not_committed_with_the_older_request(bench: Bench, reads: int):
    """It comes while the firmware prepares the older, committed request, and is revoked."""
    mailbox = bench.mailbox
    mailbox.candidate(START)
    mailbox.commit()
    left = [reads]

    def newer() -> int:
        word = mailbox.read_register("REQUEST")
        left[0] -= 1
        if left[0] == 0:
            mailbox.candidate(H("0F 0000 0020 04 3F04 6655"))
        return word

    mailbox.reads["REQUEST"] = newer
    bench.poll()
    mailbox.reads.clear()
    bench.character()
    bench.telegram_ends()
    bench.wait(400)
    bench.request(H("05 0009 0000"))
    assert bench.telegrams[-1] in (H("81 0000 0000"), H("81 047C 1999")), "bits of the revoked request"


@pytest.mark.rule("SAFE-4", "LOOP-1")
def test_the_loopback_test_is_closed_at_every_normal_start(bench: Bench):
    written = []
    bench.mailbox.writes["SUPERVISOR"] = lambda **fields: written.append(fields)
    bench.restart()
    asked = [{name for name, value in fields.items() if value} for fields in written]
    assert asked == [{"loopback"}], "a flipped switch cannot open it later either"


@pytest.mark.rule("FRAME-3", "FRAME-6")
@each_row("pdu", [H("06 0002 0063"), H("05 0040 FF00"), H("0F 0000 0020 04 7C 04 00 20")])
def test_a_revoked_request_whose_ticket_returns_changes_nothing(bench: Bench, pdu: bytes):
    """15 candidates come and go between two rounds of the poll loop; the 16th has the ticket of the first."""
    images = [H("03 0001 0002"), H("01 0000 0020"), H("01 0040 0001")]
    for each in images:
        bench.local(each)
    bench.ask_drive(READ_514)
    bench.offer(pdu)
    bench.character()
    for _ in range(15):
        bench.mailbox.candidate(READ_IND)
        bench.mailbox.character()
    bench.local(READ_IND)
    bench.drive(TELL_514)
    for each in images:
        bench.local(each)
    assert bench.replies[-3:] == bench.replies[:3]
    bench.request(H("05 000A FF00"))
    assert bench.telegrams[-1] == H("81 0400 0000")


@pytest.mark.rule("FRAME-6")
def test_a_request_replaced_while_it_is_decoded_is_not_answered(bench: Bench):
    mailbox = bench.mailbox

    def replaced() -> int:
        mailbox.reads.clear()
        mailbox.character()
        mailbox.candidate(READ_IND)
        return mailbox.length

    mailbox.reads["LENGTH"] = replaced
    mailbox.candidate(H("06 0000 0102"))
    bench.poll()
    bench.commit()
    assert bench.replies == [REPLY_IND]


@pytest.mark.rule("FRAME-5", "EXC")
def test_a_request_of_256_bytes_is_judged_by_its_whole_length(bench: Bench):
    """LENGTH has eight bits. With the right byte count the length is right, so the quantity is wrong."""
    for missing, code in ((0, 0x42), (1, 0x41)):
        bench.request(H("10 1413 007B F7") + bytes(247 - missing))
        assert bench.mailbox.length == 256 - missing
        assert bench.replies[-1] == bytes([1, 0x90, code])


# ---------------------------------------------------------------- an exchange with the drive


@pytest.mark.rule("PERF-3")
def test_the_reply_is_prepared_once_while_the_bcc_is_awaited(bench: Bench):
    """A round that prepares it again would be longer for nothing."""
    mailbox, prepared = bench.mailbox, []

    def queue(**fields: int) -> None:
        prepared.append(fields["length"])
        mailbox.write_register("REPLY", **fields)

    bench.ask_drive(READ_514)
    mailbox.writes["REPLY"] = queue
    mailbox.drive_data(TELL_514)
    for _ in range(3):
        bench.poll()
    assert prepared == [len(REPLY_514)]
    mailbox.bcc()
    assert bench.replies == [REPLY_514]


@pytest.mark.rule("FC-8", "SAFE-4")
def test_a_reply_prepared_too_late_for_its_wrong_bcc_is_never_sent(bench: Bench):
    """The wrong BCC arrives between the firmware's check and its queueing."""
    mailbox = bench.mailbox

    bench.ask_drive(READ_514)
    mailbox.drive_data(H("1202 0000 0000 0001 FFFF FFFF"))
    bench.before_write("REPLY", lambda: mailbox.bcc(good=False))
    bench.poll()
    assert not mailbox.reply_queued
    bench.drive(H(f"1203 0000 0000 0001 {STATUS}"))  # good, but another parameter
    assert bench.replies == []
    bench.drive(TELL_514)
    assert bench.replies == [REPLY_514]


@pytest.mark.rule("FC-8")
def test_without_a_telegram_nothing_is_prepared_from_the_last_one(bench: Bench):
    """The drive's last answer is still in the memory, and would fit the same request."""
    bench.exchange(READ_514, TELL_514)
    assert bench.replies == [REPLY_514]
    bench.ask_drive(READ_514)
    written = []
    bench.mailbox.writes["REPLY"] = lambda **fields: written.append(fields)
    bench.wait(20)
    assert bench.telegrams == [ASK_514, ASK_514]
    assert written == []


# ---------------------------------------------------------------- a silent drive


@pytest.mark.rule("FC-9")
def test_the_wait_is_never_too_short(bench: Bench):
    """A telegram ends just before a tick, in a round that still has the time of the tick before."""
    mailbox, wait = bench.mailbox, 150 * 12 // 10
    bench.request(READ_514)
    began = mailbox.ticks
    mailbox.ticks = began + 1
    mailbox.telegram_ends()
    for tick in range(wait + 1):
        mailbox.ticks = began + 1 + tick
        bench.gateway.poll()
        bench.gateway.poll()
        assert len(bench.telegrams) == 1, tick
    mailbox.ticks += 2
    bench.poll()
    assert len(bench.telegrams) == 2


@pytest.mark.rule("FC-9", "MAP-5")
@each_row("tens", [1, 2, 50, 5462])
def test_the_wait_is_register_40003(bench: Bench, tens: int):
    bench.local(bytes([6, 0, 2]) + tens.to_bytes(2, "big"))
    bench.ask_drive(READ_514)
    bench.wait(10 * tens)
    assert len(bench.telegrams) == 1
    bench.wait(OVERDUE_MS)
    assert len(bench.telegrams) == 2


@pytest.mark.rule("FRAME-7", "LED-4")
def test_a_drive_whose_repeat_is_refused_has_not_replied(bench: Bench):
    """A newer request is committed just before the firmware orders the repeat."""
    mailbox = bench.mailbox

    bench.ask_drive(READ_514)
    bench.before_write("TELEGRAM", lambda: (mailbox.candidate(READ_IND), mailbox.commit()))
    bench.wait(150 + OVERDUE_MS)
    bench.wait(20)
    assert bench.telegrams == [ASK_514] and bench.replies == [REPLY_IND]
    assert mailbox.counter("COUNT_DRIVE_NO_REPLY") == 1


@pytest.mark.rule("FC-6", "MAP-1", "FC-9")
@each_row("pdu", [READ_514, H("05 0006 FF00"), H("06 040F 003C")])
def test_the_status_image_outlives_the_drive(bench: Bench, pdu: bytes):
    """A good reply updates it, and nothing else changes it."""
    bench.exchange(READ_514, H("1202 0000 0000 012C 8421 C0DE"))
    for _ in range(2):
        bench.request(pdu)
        bench.drive_is_silent(2)
        assert bench.replies[-1] == bytes([1, pdu[0] | 0x80, 0xFF])
        bench.local(H("01 0020 0020"))
        assert bench.replies[-1] == H("01 01 04 21 84 DE C0")
    bench.drive(H("0000 0000"))
    bench.local(H("01 0020 0020"))
    assert bench.replies[-1] == H("01 01 04 21 84 DE C0"), "nobody listened"


# ---------------------------------------------------------------- committed writes that wait

START, STOP = H("0F 0000 0020 04 7C04 9919"), H("0F 0000 0020 04 3C04 0000")
TELEGRAM_OF_START, TELEGRAM_OF_STOP = H("047C 1999"), H("043C 0000")
SET_207, SET_207_AGAIN = H("06 0815 0064"), H("06 0815 0065")
TELEGRAM_OF_207, TELL_207 = H("20CF 0000 0000 0064 0000 0000"), H(f"10CF 0000 0000 0064 {STATUS}")
TELEGRAM_OF_207_AGAIN = H("20CF 0000 0000 0065 0000 0000")


def to(unit: str, data: bytes) -> bytes:
    return bytes([0x80 if unit == "all" else 0x81]) + data


@pytest.mark.rule("FC-9")
@each_row("before", ["reading", "text", "write", "broadcast", "repeated"])
@each_row("unit", ["all", "us"])
def test_a_dead_drive_holds_up_a_stop_for_150_ms_at_most(bench: Bench, before: str, unit: str):
    bench.local(H("06 0002 03E8"))  # 10 s
    if before == "text":
        bench.local(H("06 0000 0400"))
    request = {"text": H("03 14D1 000A"), "write": START, "broadcast": START}.get(before, READ_514)
    bench.ask_drive(request, broadcast=before == "broadcast")
    if before == "repeated":
        bench.wait(10000 + OVERDUE_MS)
        bench.telegram_ends()
    bench.request(READ_514)
    if before == "broadcast":
        bench.telegram_ends()
    count = len(bench.telegrams)
    bench.wait(20)
    bench.request(STOP, broadcast=unit == "all")
    for _ in range(2):
        bench.wait(130 + OVERDUE_MS)
        bench.telegram_ends()
    assert to(unit, TELEGRAM_OF_STOP) in bench.telegrams[count - 1 : count + 1]
    assert len(bench.telegrams) <= count + 1, "nothing is repeated while it waits"


@pytest.mark.rule("FRAME-6", "SAFE-3")
def test_a_telegram_queued_too_late_frees_the_drive_line(bench: Bench):
    mailbox = bench.mailbox

    bench.before_write("TELEGRAM", lambda: (mailbox.character(), mailbox.candidate(READ_IND)))
    bench.offer(READ_514)
    bench.commit()
    assert bench.replies == [REPLY_IND]
    bench.request(READ_514)
    assert bench.telegrams == [ASK_514]


@pytest.mark.rule("FC-9", "SAFE-1")
def test_an_old_repeat_does_not_leave_with_the_licence_of_a_newer_candidate(bench: Bench):
    """The candidate comes just before the firmware orders the repeat of the start anew."""
    mailbox = bench.mailbox
    bench.ask_drive(START)
    mailbox.quiet = False
    bench.request(H("05 0040 FF00"))
    bench.before_write("TELEGRAM", lambda: bench.before_write("TELEGRAM", lambda: mailbox.candidate(STOP)))
    bench.wait(155)
    mailbox.pause_over()
    bench.commit()
    bench.telegram_ends()
    assert bench.telegrams[1:] == [to("us", TELEGRAM_OF_STOP)]


# ---------------------------------------------------------------- LEDs

POWER_UP_SHOW = [
    *(DRIVE_RED, DRIVE_GREEN, DRIVE_RED | DRIVE_GREEN, 0),
    *(NETWORK_RED, NETWORK_GREEN, NETWORK_RED | NETWORK_GREEN, 0),
]


def shown(bench: Bench, ms: int) -> list[tuple[int, int]]:
    """The LED states of the next `ms`, each with its duration."""
    states: list[tuple[int, int]] = []
    for _ in range(ms):
        bench.wait(1)
        if states and states[-1][0] == bench.mailbox.led:
            states[-1] = (states[-1][0], states[-1][1] + 1)
        else:
            states.append((bench.mailbox.led, 1))
    return states


@pytest.mark.rule("LED-1", "LED-2", "LED-3", "LED-4")
@each_row("start", [0, 30000, 65000])
def test_power_up_shows_each_colour_of_each_led_then_both_flash_red(bench: Bench, start: int):
    bench.mailbox.time = start
    bench.restart()
    show = shown(bench, 4000)
    assert [state for state, _ in show[:8]] == POWER_UP_SHOW
    # The first tick sets the first state, which therefore counts one ms less.
    assert [ms for _, ms in show[:8]] == [249] + [250] * 7
    red = DRIVE_RED | NETWORK_RED
    assert show[8:12] == [(red, 500), (0, 500), (red, 500), (0, 500)]


def lit(bench: Bench) -> int:
    """The LEDs lit in the next flash."""
    return max(state for state, _ in shown(bench, 1000))


FRAMES_FOR_US_OR_ALL = {
    "a local reading": (READ_IND, False),
    "an unknown function": (H("2B"), False),
    "a broadcast to the card": (H("06 0000 0001"), True),
    "a broadcast to the drives": (H("05 0006 FF00"), True),
    "a reading": (READ_514, False),
    "a wrong length": (H("03 00"), False),
    "a broadcast reading": (READ_IND, True),
}


@pytest.mark.rule("LED-3", "MAP-9")
@each_row("what", FRAMES_FOR_US_OR_ALL)
def test_every_good_frame_feeds_the_network_led(bench: Bench, what: str):
    """A good frame for this card or for all: it turns the LED green, and restarts the time-out."""
    colours = NETWORK_RED | NETWORK_GREEN
    bench.local(H("06 0001 012C"))  # 300 x 10 ms
    bench.wait(4000)
    assert lit(bench) & colours == NETWORK_RED
    pdu, broadcast = FRAMES_FOR_US_OR_ALL[what]
    for _ in range(2):
        bench.ask_drive(pdu, broadcast=broadcast)
        bench.wait(1700)
        assert lit(bench) & colours == NETWORK_GREEN
    bench.wait(400)
    assert lit(bench) & colours == NETWORK_RED


@pytest.mark.rule("LED-3", "MAP-5")
@each_row("tens", [5462, 6000, 0xFFFF])
def test_long_network_time_outs_are_kept(bench: Bench, tens: int):
    """5462 x 10 ms are the first that do not fit 16 bits of ticks. The register TIME wraps after 213 ms."""

    def pass_by(ms: int) -> None:
        for _ in range(ms // 200):
            bench.mailbox.time += 200
            bench.gateway.poll()

    bench.wait(3000)
    bench.local(H("06 0001") + tens.to_bytes(2, "big"))
    pass_by(10 * tens - 1500)
    assert lit(bench) & (NETWORK_RED | NETWORK_GREEN) == NETWORK_GREEN
    bench.wait(800)
    assert lit(bench) & (NETWORK_RED | NETWORK_GREEN) == NETWORK_RED


@pytest.mark.rule("LOOP-1", "LED-1")
@on_the_host
def test_a_failed_loopback_test_shows_both_leds_red_after_the_power_up_show(bench: Bench):
    """Without the pattern on the lines. The LEDs of a card without a master would flash."""
    bench.mailbox.loopback = True
    bench.restart()
    assert [state for state, _ in shown(bench, 1990)] == POWER_UP_SHOW
    bench.wait(110)
    for _ in range(100):
        bench.wait(10)
        assert bench.mailbox.led == NETWORK_RED | DRIVE_RED


# ---------------------------------------------------------------- speed and stack of the card's image

WORST_REQUESTS = {
    "all coils": H("01 0000 0080"),
    "32 coils": H("0F 0000 0020 04 FFFFFFFF"),
    "last parameter": H("03 4FF5 0002"),
    "text of 20": H("10 14D1 000A 14") + b"12345678901234567890",
    "local registers": H("10 0000 0003 06 0500 03E8 000F"),
    "unknown function": H("2B"),
}


IDLE_ROUND = 172  # instructions, at most


def instructions_until(bench: Bench, happened: str) -> int:
    """Instructions until the mailbox's flag is set, if the poll loop has just missed the event."""
    machine = bench.gateway
    start = machine.state.instructions
    bench.mailbox.time += 1  # so that the LEDs are updated too
    while not getattr(bench.mailbox, happened):
        machine.step()
        assert machine.state.instructions < start + 20000
    return machine.state.instructions - start + IDLE_ROUND


@pytest.mark.rule("PERF-1", "PERF-2")
@each_row("what", WORST_REQUESTS)
def test_every_request_is_queued_in_time(what: str):
    """At the highest rates the candidate comes 1500 us before t3.5: 18000 clocks, 5 to 6 per instruction."""
    bench = Bench(CARD)
    bench.local(H("06 0000 0500"))
    bench.mailbox.candidate(WORST_REQUESTS[what])
    to_drive = what in ("32 coils", "last parameter", "text of 20")
    needed = instructions_until(bench, "telegram_queued" if to_drive else "reply_queued")
    print(f"{what}: {needed} instructions")
    assert needed < 2000


@pytest.mark.rule("PERF-3")
def test_a_text_reply_is_queued_before_its_bcc():
    """A character of the drive takes 1146 us: 13750 clocks."""
    bench = Bench(CARD)
    bench.local(H("06 0000 0400"))
    bench.ask_drive(H("03 1841 000A"))
    bench.mailbox.drive_data(H("F26D 0400") + b"12345678901234567890" + H(STATUS))
    needed = instructions_until(bench, "reply_queued")
    print(f"text of 20: {needed} instructions")
    assert needed < 2000


@pytest.mark.rule("FRAME-7")
def test_a_commit_is_seen_before_the_next_candidate():
    """0.6 ms at 115200 bit/s are 20,600 clocks of the small card, which takes up to 60 for an instruction."""
    bench = Bench(CARD)
    looks: list[int] = []

    def look() -> int:
        looks.append(bench.gateway.state.instructions)
        return bench.mailbox.read_register("REQUEST")

    bench.local(H("06 0000 0400"))
    bench.ask_drive(H("03 1841 000A"))
    bench.offer(START, broadcast=True)
    bench.mailbox.reads["REQUEST"] = look
    bench.drive(H("F26D 0400") + b"12345678901234567890" + H(STATUS))
    bench.wait(5)
    longest = max(later - earlier for earlier, later in pairwise(looks))
    print(f"text of 20: {longest} instructions between two looks at the request")
    assert longest < 340


def test_an_idle_round_is_short():
    bench = Bench(CARD)
    longest = 0
    for _ in range(2000):
        before = bench.gateway.state.instructions
        bench.mailbox.time += 1
        bench.gateway.poll()
        longest = max(longest, bench.gateway.state.instructions - before)
    print(f"idle round: {longest} instructions")
    assert longest < IDLE_ROUND


@pytest.mark.rule("PERF-4")
def test_the_stack_stays_far_from_the_variables():
    bench = Bench(CARD)
    for request in WORST_REQUESTS.values():
        bench.ask_drive(request)
        bench.wait(400)
    used = bench.gateway.state.memory_size - bench.gateway.state.lowest_sp
    print(f"stack: {used} bytes")
    assert 0 < used <= reserved()


# ---------------------------------------------------------------- idle rounds, watchdog, events


@pytest.mark.rule("LED-5")
@on_the_host
def test_the_poll_loop_is_idle_only_without_a_request_or_exchange(bench: Bench):
    """In an idle round without a new tick the main loop checks a word of the image or the settings."""

    def idle() -> bool:
        found = bench.gateway.is_idle()
        assert bench.gateway.poll() == found
        bench.mailbox.time += 1
        assert not bench.gateway.poll(), "the work of a tick"
        return found

    assert idle()
    bench.offer(READ_IND)
    assert not idle(), "a candidate"
    bench.commit()
    assert idle()
    bench.request(READ_514)
    assert not idle(), "a telegram on the line"
    bench.telegram_ends()
    assert not idle(), "a drive that thinks"
    bench.drive(TELL_514)
    assert idle()
    bench.mailbox.loopback = True
    bench.restart()
    assert idle(), "the loop-back test, in which the image is checked too"


@pytest.mark.rule("WDG-1")
def test_the_watchdog_is_kicked_in_every_state():
    bench = Bench(CARD)

    def kicks(ms: int) -> int:
        """In each round; `wait` has two a millisecond."""
        before = bench.mailbox.kicks
        bench.wait(ms)
        return (bench.mailbox.kicks - before) // 2

    bench.offer(READ_514)
    assert kicks(50) == 50, "a candidate"
    bench.commit()
    assert kicks(15) == 15, "a telegram on the line"
    bench.telegram_ends()
    assert kicks(400) == 400, "a silent drive"


EVENTS = ("crc", "parity", "framing", "t15", "overrun", "revoked", "foreign", "drive_bad")


@pytest.mark.rule("FRAME-4", "FC-8")
def test_each_event_is_counted_in_its_own_counter(bench: Bench):
    """Several events of one kind in one round count once."""
    for n, event in enumerate(EVENTS, 1):
        for _ in range(n):
            bench.mailbox.event(event)
            bench.mailbox.event(event)
            bench.poll()
    assert [bench.mailbox.counter(f"COUNT_{event.upper()}") for event in EVENTS] == list(range(1, 9))
    for event in EVENTS:
        bench.mailbox.event(event)
    bench.poll()
    assert [bench.mailbox.counter(f"COUNT_{event.upper()}") for event in EVENTS] == list(range(2, 10))
    assert bench.mailbox.events == 0


@pytest.mark.rule("FRAME-4")
def test_an_event_between_reading_and_clearing_is_not_lost(bench: Bench):
    mailbox = bench.mailbox

    bench.before_write("EVENTS", lambda: mailbox.event("t15"))
    mailbox.event("crc")
    bench.poll()
    bench.poll()
    assert mailbox.counter("COUNT_CRC") == 1 and mailbox.counter("COUNT_T15") == 1


# ---------------------------------------------------------------- loss of the master

STOP_DUE = REGISTERS["EXCHANGE"].pack(stop_due=1)


SEND_START, SEND_STOP = H("81 047C 1999"), H("81 043C 1999")
SET_TIMEOUT, TIMEOUT_MS = H("06 0001 0008"), 80
READ_CONTROL = H("01 0000 0010")


@pytest.fixture
def running() -> Bench:
    """A card with MASTER_LOSS_STOP, 40002 set and the drive started."""
    bench = Bench(Build(option="MASTER_LOSS_STOP"))
    bench.local(SET_TIMEOUT)
    bench.request(START)
    bench.drive_answers(H(STATUS))
    assert bench.telegrams == [SEND_START]
    return bench


@pytest.mark.rule("SAFE-7")
def test_the_image_keeps_the_start_if_the_gate_has_no_licence_any_more(running: Bench):
    mailbox = running.mailbox

    def refused(**order: int) -> None:
        if order["stop"]:
            mailbox.since = mailbox.ticks
            mailbox.ticks += 12  # a long round
        mailbox.write_register("TELEGRAM", **order)

    mailbox.writes["TELEGRAM"] = refused
    running.wait(TIMEOUT_MS + 20)
    assert running.telegrams == [SEND_START]
    assert mailbox.counter("COUNT_DRIVE_NO_REPLY") == 0, "the drive was not asked"
    running.local(READ_CONTROL)
    assert running.replies[-1] == H("01 01 02 7C04")
