"""Reports of a rover in an event loop."""

from __future__ import annotations

import asyncio

from axlewire._axlewire import Report, Reports

# A task that is cancelled leaves its thread after this time.
MOMENT_S = 0.05


async def next_report(reports: Reports) -> Report:
    """The next report; ends the iteration once the line is closed."""
    loop = asyncio.get_running_loop()
    while True:
        report = await loop.run_in_executor(None, reports.next, MOMENT_S)
        if report is not None:
            return report
        if reports.is_over:
            raise StopAsyncIteration
