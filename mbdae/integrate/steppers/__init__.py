"""Who takes the steps of a run: fixed ones, controlled ones, scipy's, or those of the compiled core."""
