"""What is kept: closures of loops and drivers, their rows of g, and which of the rows are independent."""
