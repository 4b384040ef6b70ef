"""Time integration: the time loop, events, jumps, singular configurations, and diagnostics of the result."""
