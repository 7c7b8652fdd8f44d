"""The time of recording. A file of events states when events occurred, not when the network was switched on."""

import numpy as np
from numpy.typing import NDArray

FIRST, LAST = np.datetime64("1678-01-01"), np.datetime64("2261-12-31")  # limits of times in nanoseconds
# A longer silence has a chance of 0.1 % if days with events are random.
MAX_SILENCE_IN_MEAN_WAITS = np.log(1000.0)
ALL_STEPS = "all"  # Name, in addition to those of the steps, of all dated steps together.


def recorded_period(time: NDArray) -> tuple[np.datetime64, np.datetime64]:
    """First and last instant (UTC, ns) of recording, from the times of all events of a file, NaT ignored.

    Whole days from the first to the last event, and on either side as much silence as chance may leave: where the
    first event comes later, the record begins with that silence before it; so at its end. Of fewer than
    two days with events the silence is without bounds: all of time.
    """
    time = np.asarray(time, "datetime64[ns]")
    days = np.unique(time[~np.isnat(time)].astype("datetime64[D]"))
    if len(days) < 2:
        return FIRST.astype("datetime64[ns]"), LAST.astype("datetime64[ns]")
    wait = int(np.ceil(MAX_SILENCE_IN_MEAN_WAITS * (days[-1] - days[0]).astype(int) / (len(days) - 1)))
    # in days, which reach further than nanoseconds do: decades of silence would come round at the other end
    return max(days[0] - wait, FIRST).astype("datetime64[ns]"), min(days[-1] + 1 + wait, LAST).astype("datetime64[ns]")
