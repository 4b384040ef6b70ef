"""What is drawn: the shapes of a mechanism and where they are attached."""
