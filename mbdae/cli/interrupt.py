"""Ctrl-C while the command line is still being imported: one line, and the exit code of shells for it.

Imported first; the handler stands until `release`, where errors can be caught. An exception will not do: it would come
out of the middle of other packages' imports, as whatever they make of it.
"""

import os
import signal
import sys
from pathlib import Path
from types import FrameType

CODE = 130  # 128 and the number of SIGINT


def release() -> None:
    """Let Ctrl-C be a KeyboardInterrupt again."""
    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _end(number: int, frame: FrameType | None) -> None:
    os.write(2, b"mbdae: stopped by the user\n")
    os._exit(CODE)


def _command_line() -> bool:
    """Whether this process is mbdae's own, and not one that uses it, or a worker."""
    script = [Path(word).stem for word in sys.orig_argv[1:2]]
    return script == ["mbdae"] or sys.orig_argv[1:3] == ["-m", "mbdae"]


if _command_line() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _end)
