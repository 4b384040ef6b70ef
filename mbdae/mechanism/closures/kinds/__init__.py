"""Kinds of closures, one file each: its keys, rows, preconditions and what it keeps."""
