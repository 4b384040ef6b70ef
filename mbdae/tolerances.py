"""Tolerances: every small number that a decision depends on, with its scale and its reason.

Each serves one purpose. Modules use it directly, or under a local name; another value for the same purpose is a
factor or a power of it. Finite-difference steps, smallest step sizes and default arguments are not tolerances. The
core receives these numbers from Python.
"""

from sys import float_info

EPS = float_info.epsilon  # relative to a number: distance to the next one
TINY = 1e-100  # in any unit: avoids division by zero; its square does not underflow

# Rounding errors, in order of increasing computation.
PUBLISHED_DECIMALS = 1e-20  # absolute: rounded coefficients of the literature, in exact arithmetic
BELOW_ROUNDING = 1e-16  # relative to a sum or a state: changes lost in its rounding; iterations end here at the latest
ROUNDING = 1e-15  # relative to a number, to 1 + |y|: a few roundings; equality, or the best accuracy of an iteration
SUM_ROUNDING = 1e-14  # relative to the largest term: sums of tens of terms, products of matrices, pivots of elimination
EVALUATION_ROUNDING = 1e-13  # relative to the size of g, positions, speeds: kinematics along chains of bodies
SOLUTION_ROUNDING = 1e-12  # relative to the unknowns, to rad or characteristic lengths: linear systems, closed loops
ITERATION_ROUNDING = 1e-11  # relative to the terms of a sum: residuals where conditioning stops Newton's iteration
MODE_ROUNDING = 1e-10  # relative to the largest speed, multiplier or energy: zeros of complementarity problems
JUMP_MARGIN = 8  # multiple of the spacing at t: between the end of a step and a jump, above errors of stage times

# Searches and comparisons.
SEARCH_TOLERANCE = 1e-10  # relative to the bracket, or to 1 + |q|: roots, minima, corrections
AGREEMENT = 1e-10  # relative to a quantity, to a step: two computations agree to the tightest rtol in common use
SAME_STATE = 1e-7  # relative to 1 + |y|: one state computed in two ways; ill-conditioning limits it to sqrt(EPS)
SAME_POSE = 1e-6  # rad or characteristic lengths: poses of one curve, traced from both ends
SMALLEST_PART = 1e-7  # relative to a span or a range: shorter intervals count as points

# Geometry and motion.
COINCIDENT = 1e-9  # relative to the size of the bodies, a step, a period or a limit: coincident points and times
CLOSED = 1e-9  # rad or characteristic lengths: gaps of closed loops and of bodies in contact
PARALLEL = 1e-6  # rad, or a cosine of perpendicular axes: angles in files have six digits
ZERO_SPEED = 1e-9  # relative to the characteristic or largest speed or acceleration: its direction is undefined
SHORTEST_FLIGHT = 1e-6  # s: shorter flights between impacts end in sustained contact
UNINVOLVED = 1e-9  # relative to a unit vector: components of joints and contacts that are not involved
REAL = 1e-9  # in brackets of length 1: imaginary part of a real root of a polynomial after rounding

# Rank.
RANK = 1e-9  # relative to the largest singular value: linearly dependent rows and columns, at exact positions
PIVOT_RANK = 1e-8  # relative to the largest pivot: RANK for pivots, which overestimate the smallest singular value
TRUNCATION = 1e-7  # relative to the largest singular value: directions in which a correction would amplify the residual
AMBIGUOUS_PIVOT = 1e-5  # relative to the largest pivot: closer to linear dependence than interpolated positions resolve

# Accuracy of input and output.
HALF_DIGITS = 1e-8  # relative to a norm, the largest force, a state: sqrt(EPS), half the digits of a double
INPUT_DIGITS = 1e-6  # relative to a number, 1 rad or characteristic lengths: numbers in files have six digits
VISIBLE = 1e-6  # relative to the largest speed, multiplier or term: smaller violations do not appear in six digits
INTERPOLATION = 1e-5  # relative to the size of a curve: errors of interpolants and of difference quotients
COARSE = 1e-4  # relative to a search interval: a first estimate, which a later step refines
THREE_DIGITS = 1e-3  # relative to a length, rad, a rate: numbers given with three digits
SIGNIFICANCE_LEVEL = 1e-6  # level of chi-squared tests: larger residuals are not attributed to noise
NEGLIGIBLE = 1e-3  # relative to the largest term, a tolerance, a unit: contributions without effect on a decision
