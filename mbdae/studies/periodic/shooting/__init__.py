"""Multiple shooting: the flow over a segment of a period, the equations, their solution, and Floquet multipliers."""
