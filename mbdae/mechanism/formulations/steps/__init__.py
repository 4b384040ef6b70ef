"""Steps of a mechanism: stages, projection, selection of rows, dense output."""
