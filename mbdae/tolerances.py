"""Tolerances: every small number that decides something, each with its scale and its reason.

Each serves one purpose. Modules use it directly, or under a local name; another value for the same purpose is a
factor or a power of it. Finite-difference steps, smallest step sizes and default arguments are not tolerances. The
core receives these numbers from Python.
"""

from sys import float_info

EPS = float_info.epsilon  # of a number: distance of the next one
TINY = 1e-100  # in any unit: avoids division by zero; its square does not underflow

# Rounding, in the order of what was computed.
PUBLISHED_DECIMALS = 1e-20  # of 1: rounded coefficients of the literature, in exact arithmetic
BELOW_ROUNDING = 1e-16  # of a sum or a state: changes that it does not show; iterations end here at the latest
ROUNDING = 1e-15  # of a number, of 1 + |y|: a few roundings; equality, or the attainable accuracy of an iteration
SUM_ROUNDING = 1e-14  # of the largest term: sums of tens of terms, products of matrices, pivots of elimination
EVALUATION_ROUNDING = 1e-13  # of the size of g, of positions, of speeds: kinematics along chains of bodies
SOLUTION_ROUNDING = 1e-12  # of the unknowns, of rad or characteristic lengths: solved linear systems, closed loops
ITERATION_ROUNDING = 1e-11  # of the terms of a sum: residuals where conditioning stops Newton's iteration
MODE_ROUNDING = 1e-10  # of the largest speed, multiplier or energy: zeros of impact and complementarity problems
JUMP_MARGIN = 8  # of the spacing of numbers at t: between the end of a step and a jump, above errors of stage times

# Searches and comparisons.
SEARCH_TOLERANCE = 1e-10  # of the bracket, or of 1 + |q|: roots, minima and corrections that decide nothing else
AGREEMENT = 1e-10  # of the size of a quantity, of a step: two computations of it agree to the tightest common rtol
SAME_STATE = 1e-7  # of 1 + |y|: states reached in two ways; ill-conditioned directions limit them to the root of EPS
SAME_POSE = 1e-6  # rad or characteristic lengths: poses of curves that were followed from two sides
SMALLEST_PART = 1e-7  # of a span or a range: shorter intervals count as points

# Geometry and motion.
COINCIDENT = 1e-9  # of the size of the bodies, of a step, a period or a limit: coincident points and times
CLOSED = 1e-9  # rad or characteristic lengths: gaps of closed loops and of touching bodies
PARALLEL = 1e-6  # rad, or a cosine of perpendicular axes: angles in files have six digits
ZERO_SPEED = 1e-9  # of the characteristic or largest speed or acceleration: its direction is undefined
SHORTEST_FLIGHT = 1e-6  # s: shorter flights between impacts end in sustained contact
UNINVOLVED = 1e-9  # of a unit vector: components of joints and contacts that are not involved
REAL = 1e-9  # of an imaginary part in brackets of length 1: roots of a polynomial split by their rounding

# Rank.
RANK = 1e-9  # of the largest singular value: rows and columns that are exactly dependent, in exact positions
PIVOT_RANK = 1e-8  # of the largest pivot: like RANK, for pivots, which overestimate the smallest singular value
TRUNCATION = 1e-7  # of the largest singular value: directions in which a correction would amplify the residual
AMBIGUOUS_PIVOT = 1e-5  # of the largest pivot: closer to dependence than interpolated positions can resolve

# Accuracy of numbers that are given and shown.
HALF_DIGITS = 1e-8  # of a norm, of the largest force, of a state: the root of EPS, whose square is rounding
INPUT_DIGITS = 1e-6  # of a number, rad or characteristic lengths: numbers in files have six digits
VISIBLE = 1e-6  # of the largest speed, multiplier or term: smaller violations do not show in results of six digits
INTERPOLATION = 1e-5  # of the size of a curve: errors of interpolants and of difference quotients
COARSE = 1e-4  # of a search interval: a first estimate, which a later step refines
THREE_DIGITS = 1e-3  # of a length, rad, a rate: numbers that were given with three digits
SIGNIFICANCE_LEVEL = 1e-6  # of chi-squared tests: residuals that noise exceeds less often are not noise
NEGLIGIBLE = 1e-3  # of the largest share, of a tolerance, of a unit: contributions without influence on a decision
