"""Command line: shared options, output, and Ctrl-C."""
