# SPDX-License-Identifier: Apache-2.0
# Generated from regs/mailbox.rdl by `make regs`; edit that file, not this one.
"""The mailbox map: registers from BASE on, frames and counters from FRAMES on, in bytes."""

from regs.areas import Area, Field, Register

BASE = 0xFFFFF800
FRAMES = 0xFFFFFF00
FRAMES_BYTES = 256

REGISTERS = {
    "REQUEST": Register(
        0x00,
        1,
        {
            "ticket": Field(0, 4, 0x0, "ticket"),
            "candidate": Field(4, 1, 0x0, "is_candidate"),
            "committed": Field(5, 1, 0x0, "is_committed"),
            "broadcast": Field(6, 1, 0x0, "frame_broadcast"),
            "bank": Field(7, 1, 0x0, "frame_bank"),
        },
    ),
    "EXCHANGE": Register(
        0x01,
        1,
        {
            "queued": Field(0, 1, 0x0, "telegram_queued"),
            "sending": Field(1, 1, 0x0, "drive_sending"),
            "started": Field(2, 1, 0x0, "telegram_started"),
            "candidate": Field(3, 1, 0x0, "drive_candidate"),
            "good": Field(4, 1, 0x0, "drive_good"),
            "loopback": Field(5, 1, 0x0, "loopback_open"),
            "heard": Field(6, 1, 0x0, "loopback_heard"),
            "stop_due": Field(7, 1, 0x0, "stop_due"),
        },
    ),
    "LENGTH": Register(
        0x02,
        1,
        {
            "bytes": Field(0, 8, 0x0, "frame_length"),
        },
    ),
    "TIME": Register(
        0x03,
        1,
        {
            "ticks": Field(0, 8, 0x0, "ticks"),
        },
    ),
    "EVENTS": Register(
        0x04,
        1,
        {
            "crc": Field(0, 1, 0x0, "count_crc"),
            "parity": Field(1, 1, 0x0, "count_parity"),
            "framing": Field(2, 1, 0x0, "count_framing"),
            "t15": Field(3, 1, 0x0, "count_t15"),
            "overrun": Field(4, 1, 0x0, "count_overrun"),
            "revoked": Field(5, 1, 0x0, "revoke"),
            "foreign": Field(6, 1, 0x0, "count_foreign"),
            "drive_bad": Field(7, 1, 0x0, "drive_bad"),
        },
    ),
    "RESTARTS": Register(
        0x05,
        1,
        {
            "count": Field(0, 8, 0x0, "restarts"),
        },
    ),
    "REPLY": Register(
        0x08,
        4,
        {
            "length": Field(0, 5, None),
            "after_drive": Field(5, 1, None, "reply_after_drive"),
            "ticket": Field(8, 4, None, "order_ticket"),
        },
    ),
    "TELEGRAM": Register(
        0x0C,
        4,
        {
            "length": Field(0, 5, None),
            "no_reply": Field(5, 1, None, "order_no_reply"),
            "action": Field(6, 2, None),
            "ticket": Field(8, 4, None, "order_ticket"),
            "stop": Field(12, 1, None, "order_stop"),
            "early": Field(13, 1, None, "order_early"),
        },
    ),
    "LED": Register(
        0x10,
        4,
        {
            "modbus_red": Field(0, 1, 0x0, "lit_modbus_red"),
            "modbus_green": Field(1, 1, 0x0, "lit_modbus_green"),
            "drive_red": Field(2, 1, 0x0, "lit_drive_red"),
            "drive_green": Field(3, 1, 0x0, "lit_drive_green"),
        },
    ),
    "LISTEN": Register(
        0x14,
        4,
        {
            "on": Field(0, 1, None),
        },
    ),
    "WATCHDOG": Register(
        0x18,
        4,
        {
            "key": Field(0, 8, 0xA5),
            "strict_t15": Field(8, 1, None),
            "break_tolerant": Field(9, 1, None),
        },
    ),
    "SUPERVISOR": Register(
        0x1C,
        4,
        {
            "halt": Field(0, 1, 0x0, "halt", pulse=True),
            "loopback": Field(1, 1, 0x0, "loopback_close", pulse=True),
            "watch": Field(2, 1, 0x0, "watch_master", pulse=True),
            "running": Field(3, 1, None, "running"),
            "ticket": Field(8, 4, None, "order_ticket"),
            "period": Field(12, 20, None, "period"),
        },
    ),
}

# Named values of the field of a register.
VALUES = {
    ("TELEGRAM", "action"): {"first": 0, "repeat": 1, "write": 2, "image": 3},
}

AREAS = {
    "REPLY_FRAME": Area(0x00, 32, 1),
    "TELEGRAM_FRAME": Area(0x80, 32, 1),
    "REQUEST_FRAME_0": Area(0x01, 32, 1),
    "REQUEST_FRAME_1": Area(0x81, 32, 1),
    "DRIVE_FRAME": Area(0x02, 28, 1),
    "DRIVE_LGE": Area(0x72, 1, 1),
    "COUNT_CRC": Area(0x82, 1, 2),
    "COUNT_PARITY": Area(0x86, 1, 2),
    "COUNT_FRAMING": Area(0x8A, 1, 2),
    "COUNT_T15": Area(0x8E, 1, 2),
    "COUNT_OVERRUN": Area(0x92, 1, 2),
    "COUNT_REVOKED": Area(0x96, 1, 2),
    "COUNT_FOREIGN": Area(0x9A, 1, 2),
    "COUNT_DRIVE_BAD": Area(0x9E, 1, 2),
    "COUNT_DRIVE_NO_REPLY": Area(0xA2, 1, 2),
    "COUNT_DRIVE_REPEAT": Area(0xA6, 1, 2),
    "COUNT_REQUESTS": Area(0xAA, 1, 2),
    "COUNT_EXCEPTIONS": Area(0xAE, 1, 2),
    "COUNT_COMPLETED": Area(0xB2, 1, 2),
}
