"""Reports of a rover in an event loop."""

from __future__ import annotations

import asyncio

from axlewire._axlewire import Report, Reports

# A rover reports every 20 ms. Nothing is taken in between, so that a task that is cancelled loses
# no report.
LOOK_EVERY_S = 0.005


async def next_report(reports: Reports) -> Report:
    """The next report; ends the iteration once the line is closed."""
    while True:
        was_over = reports.is_over
        report = reports.next(0)
        if report is not None:
            return report
        if was_over:
            raise StopAsyncIteration
        await asyncio.sleep(LOOK_EVERY_S)
