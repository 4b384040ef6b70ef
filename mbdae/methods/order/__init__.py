"""Order conditions of index-2 problems: trees, weights, and reports for a tableau."""
