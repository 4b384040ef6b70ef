"""What a run leaves: states at nodes, values in between, columns for tables, and saved files."""
