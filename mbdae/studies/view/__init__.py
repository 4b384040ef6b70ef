"""Interactive view of all poses of a mechanism with sliders, as one page."""
