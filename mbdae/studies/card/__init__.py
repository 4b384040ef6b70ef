"""What a mechanism is, on one card."""
