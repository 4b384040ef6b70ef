"""Options of a run: defaults, settings of files, validation, time span."""
