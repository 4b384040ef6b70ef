"""Results of a run: states at nodes, dense output, columns for tables, and saved files."""
