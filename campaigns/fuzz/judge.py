# SPDX-License-Identifier: Apache-2.0
"""The judge of the fuzzer: tb/model/whole_card.py, and one more outcome that is right.

A reading waits for a busy drive line in place of an older request. A newer request drops it (FRAME-7). The
line becomes free while the firmware still looks at the newer request: then the reading's telegram may leave.
The slow firmware of the small card does so; flips have no traffic on a busy line. Unit of time: clocks.
"""

from __future__ import annotations

from dataclasses import dataclass

from tb.model.whole_card import NEVER, LineJudge, Request
from tb.model.wire import Burst, NetworkFrame


@dataclass
class FuzzJudge(LineJudge):
    dropped: Request | None = None  # the last reading that lost its place
    dropped_at: float = -NEVER

    def _commit(self, frame: NetworkFrame, at: float) -> None:
        gone = [older for older in self.queue if not self._keeps_place(older)]
        if gone:
            self.dropped, self.dropped_at = gone[-1], at
        super()._commit(frame, at)

    def _telegram(self, burst: Burst) -> None:
        if self._leaves_just_then(burst):
            since = self.exchange.queued_from
            self._start(self.dropped, since, burst.rise)
            self.exchange.superseded = min(self.exchange.superseded, self.dropped_at)
        super()._telegram(burst)

    def _leaves_just_then(self, burst: Burst) -> bool:
        """The dropped reading had taken the line over from the request before it."""
        exchange, dropped = self.exchange, self.dropped
        others = [request.telegram for request in self.queue]
        return (
            dropped is not None
            and burst.rise <= self.dropped_at + self.late
            and exchange is not None
            and exchange.phase == "line"
            and exchange.overtaken
            and burst.data == dropped.telegram
            and burst.data not in (exchange.request.telegram, *others)
        )
