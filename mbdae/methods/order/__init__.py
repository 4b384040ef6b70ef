"""Order conditions of index-2 problems: trees, weights, and what they say of a tableau."""
