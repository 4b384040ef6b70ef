"""Ctrl-C on the command line: an exception that commands catch; during an import, one line of text and the exit code.

This module is imported first, since commands import further modules while they start. During an import, the
exception would be raised inside other packages, which may catch or replace it. Only while Python itself starts, for a
tenth of a second, Ctrl-C still prints a traceback.
"""

import os
import signal
import sys
from types import FrameType

EXIT_CODE = 130  # 128 plus the number of SIGINT
IMPORTS = "<frozen importlib"  # file name of the import functions in tracebacks


def _stop(number: int, frame: FrameType | None) -> None:
    while frame is not None:
        if frame.f_code.co_filename.startswith(IMPORTS):
            os.write(2, b"mbdae: stopped by the user\n")
            os._exit(EXIT_CODE)
        frame = frame.f_back
    raise KeyboardInterrupt


def _command_line() -> bool:
    """Return whether this process is mbdae's command line, rather than a program that uses mbdae, or a worker."""
    script = [os.path.splitext(os.path.basename(word))[0] for word in sys.orig_argv[1:2]]  # pathlib takes 10 ms
    return script == ["mbdae"] or sys.orig_argv[1:3] == ["-m", "mbdae"]


if _command_line() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _stop)
