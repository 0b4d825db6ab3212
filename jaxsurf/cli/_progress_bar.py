"""Progress on the terminal, and Ctrl-C as a wish to stop."""

import contextlib
import signal
import sys
import threading
import time
from collections.abc import Iterator
from types import FrameType

from .._progress import Event, Progress

_SLOW = 15.0  # seconds between lines where there is no terminal to redraw


@contextlib.contextmanager
def watching(*, quiet: bool = False) -> Iterator[Progress]:
    """Give a `progress` that draws a bar (phase, iteration, rms, time left) and returns true after Ctrl-C.

    The first Ctrl-C asks the work to stop at its best result; a second one interrupts at once.
    """
    asked = threading.Event()

    def on_interrupt(number: int, frame: FrameType | None) -> None:
        if asked.is_set():
            raise KeyboardInterrupt
        asked.set()
        sys.stderr.write("\nstopping after this step; press Ctrl-C again to drop everything\n")

    main_thread = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, on_interrupt) if main_thread else None
    bar = _Silent() if quiet else _Bar() if sys.stderr.isatty() else _Lines()

    def progress(event: Event) -> bool:
        bar.show(event)
        return asked.is_set()

    try:
        yield progress
    finally:
        bar.close()
        if main_thread:
            signal.signal(signal.SIGINT, before)


class _Silent:
    def show(self, event: Event) -> None: ...

    def close(self) -> None: ...


class _Lines:
    """One line when a phase begins and now and then, for logs."""

    def __init__(self):
        self.phase, self.last = "", 0.0

    def show(self, event: Event) -> None:
        now = time.monotonic()
        if event.phase != self.phase or now - self.last > _SLOW:
            rms = "" if event.rms is None else f", rms {event.rms:.4g}"
            sys.stderr.write(f"{event.phase}: step {event.step}{rms}\n")
            self.phase, self.last = event.phase, now

    def close(self) -> None: ...


class _Bar:
    """A bar for each phase; it is full at the most steps that the phase may take, and usually ends before."""

    def __init__(self):
        from .._errors import import_optional

        self.tqdm = import_optional("tqdm", extra="app", purpose="the progress bar").tqdm
        self.phase, self.bar = None, None

    def show(self, event: Event) -> None:
        if event.phase != self.phase or self.bar is None or event.step < self.bar.n:
            self.close()
            self.phase = event.phase
            layout = "{desc}: {n_fmt}/{total_fmt} |{bar}|{postfix} [{elapsed}, at most {remaining} left]"
            self.bar = self.tqdm(total=event.steps or 1, desc=event.phase, leave=False, bar_format=layout)
        if event.rms is not None:
            self.bar.set_postfix_str(f" rms {event.rms:.4g}", refresh=False)
        self.bar.update(event.step - self.bar.n)
        self.bar.refresh()

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()
            self.bar = None
