"""Look before you run: all poses of a mechanism with sliders, as one page."""
