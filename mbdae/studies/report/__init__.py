"""Report: all studies of a mechanism on one page."""
