"""URDF files, with the loops that CAD exporters cut."""
