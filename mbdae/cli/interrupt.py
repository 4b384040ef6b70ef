"""Ctrl-C on the command line: an error that commands catch; in the middle of an import one line, and the end.

Imported first, and imports go on while commands begin. An exception would come out of the middle of other packages'
imports, as whatever they make of it. Only what Python imports itself before it comes to mbdae, a tenth of a second with
`site`, ends in Python's own traceback.
"""

import os
import signal
import sys
from types import FrameType

CODE = 130  # 128 and the number of SIGINT
IMPORTS = "<frozen importlib"  # the file of the functions that import, as Python calls it


def _stop(number: int, frame: FrameType | None) -> None:
    while frame is not None:
        if frame.f_code.co_filename.startswith(IMPORTS):
            os.write(2, b"mbdae: stopped by the user\n")
            os._exit(CODE)
        frame = frame.f_back
    raise KeyboardInterrupt


def _command_line() -> bool:
    """Whether this process is mbdae's own, and not one that uses it, or a worker."""
    script = [os.path.splitext(os.path.basename(word))[0] for word in sys.orig_argv[1:2]]  # pathlib takes 10 ms
    return script == ["mbdae"] or sys.orig_argv[1:3] == ["-m", "mbdae"]


if _command_line() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _stop)
