"""One page on a mechanism that has it all."""
