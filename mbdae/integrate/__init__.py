"""From a start to a solution: the time loop, events, jumps, singular configurations, and what the end is worth."""
