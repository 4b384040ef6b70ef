"""Motions as HTML pages and videos."""
