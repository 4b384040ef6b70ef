"""Multiple shooting: the flow over a part of a period, the equations, their solution, and Floquet multipliers."""
