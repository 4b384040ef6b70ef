"""Ctrl-C is on in tests: a shell switches it off in what it runs in the background, and children inherit that."""

import signal

signal.signal(signal.SIGINT, signal.default_int_handler)
