"""The command line: options that commands share, what they write, and Ctrl-C."""
