"""Real-time factor and frame rate of a live view."""

from time import perf_counter

PERIOD = 1.0  # s between measurements
MIN_FRAME_RATE = 25.0  # frames per second below which a page draws fewer triangles and pixels
MAX_SLOW_PERIODS = 3  # number of successive slow periods, since a page is also slow while it loads


class FrameRate:
    """Measurement of simulated seconds per second and frames per second.

    Args:
        t: simulated time in s.

    Attributes:
        real_time_factor: simulated seconds per second, over the last period.
        drawn: frames per second that the slowest page has drawn.
        slow: whether a page has drawn too few frames for several periods.
    """

    def __init__(self, t: float) -> None:
        self.real_time_factor, self.drawn, self.slow = 1.0, 0.0, False
        self._began, self._t, self._frames, self._slow_periods = perf_counter(), t, 0, 0

    def update(self, now: float, t: float, frames: int) -> None:
        """Measure if a period has passed.

        Args:
            now: time in s.
            t: simulated time in s.
            frames: number of frames that all pages have drawn; 0 without a page.
        """
        passed = now - self._began
        if passed < PERIOD:
            return
        self.real_time_factor, self.drawn = (t - self._t) / passed, (frames - self._frames) / passed
        self._slow_periods = self._slow_periods + 1 if 0 < self.drawn < MIN_FRAME_RATE else 0
        self.slow |= self._slow_periods >= MAX_SLOW_PERIODS
        self._began, self._t, self._frames = now, t, frames
