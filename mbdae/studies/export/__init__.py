"""Export of mechanisms for other programs."""
