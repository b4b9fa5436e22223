"""The numbers that the diagnosis assumes, with their units and reasons.

Others follow from these, from the data or from the catalogue, are rounding, or are told where they
are used. What halving or doubling each changes is measured by `python bench/constants.py`.
"""

from __future__ import annotations

import math

# -- evidence --------------------------------------------------------------------------------

# EBIC within which two explanations cannot be distinguished: a Bayes factor of 150, above which
# evidence is "very strong" (Kass and Raftery 1995). The most that an implausible value costs.
# Halved, families lose true members at odds of 12 to 1; doubled, they gain some at 22000 to 1.
VERY_STRONG = 10.0
# EBIC that an effect must save to be named, and that a free-form term must save beyond its
# parameters, as somebody has listed the others: a Bayes factor of 20, from which on evidence is
# "strong". Halved, one of 4.5; doubled, one of 400.
STRONG = 2 * math.log(20)
# Penalty (chi-squared) of an angle that may be anything: its prior is bounded, and a line that is
# seen at all determines it to about 0.2 rad. 2 ln(2π / (0.2 √(2π))) = 5. Doubled, hum and ripples
# need one more σ.
PHASE_PENALTY = 5.0
# Chi-squared by which two predictions must differ to be told apart, and two fits to be two minima;
# EBIC within which two explanations are equal. Halved, more sets are fitted twice.
SAME = 1.0
# Samples that a number's penalty, ln n, is taken for at the least, also of independent ones: a
# handful of precise samples determines it to a tenth of its prior. Of fewer samples the shape is
# not tested, as the limits of those distributions are not reached. Doubled, each number of a small
# table must gain 0.7 more.
LEAST_SAMPLES = 100

# -- noise -----------------------------------------------------------------------------------

# Share of tests of noise that fail by chance, over all tests of a remainder together. Doubled,
# one remainder in 500 is called unexplained by chance.
FALSE_ALARMS = 1e-3
# Standard errors by which a value must be outside a range to be clearly so (95 %). Doubled,
# 99.99 %.
CLEAR = 2.0
# Share by which what is stated may be off: the noise of a sensor, the ends of a plausible range
# (which are round numbers), the interval of the samples. Disturbances of a third of the noise pass
# for noise; doubled, those of half of it.
TOLERANCE = 0.05

# -- parts of a whole ------------------------------------------------------------------------

# Share of a whole that counts as nothing: of the information on a number, of a size, of noise.
# Doubled, more parts are cut in time to be held out.
LEAST_SHARE = 0.1
# Share of a whole that is most of it: of what an effect explains, of what is left. Halved, true
# effects go whose law is only nearly right; doubled, none.
MAJORITY = 0.5
# Cycles, frequencies or parts that a statistic over them needs at the least; chunks that a part is
# cut into if it alone tells of an effect. Doubled, slow lines are bends, and effects that few moves
# show are not asked for their spread.
FEWEST = 3
# Intervals of position, as numbers of them over the range, among which a bump is looked for.
# Doubled, narrower bumps are seen, and one in an eighth of the range is a bend.
BUMP_BINS = (8, 16, 32, 64)
# Parts of the data that are held out, at the most. Doubled, cross-validation takes twice as long
# and each part leaves less out.
MOST_FOLDS = 12

# -- search ----------------------------------------------------------------------------------

# Error of the fall of chi-squared that a signature predicts, as a share of it. Doubled, twice as
# many sets are fitted in vain.
LINEARITY_ERROR = 0.02
# Factor between two sizes within which a response is taken to be proportional. Doubled, signatures
# are simulated again less often, and predict worse.
PROPORTIONAL = 3.0
# Effects in one set. Doubled, harmonics of many lines are told, and pure noise costs no more.
MOST_EFFECTS = 6
# Sets that are fitted in one round, of those that explain different things. Doubled, a round takes
# twice as long.
FITTED = 5
# Rounds of a search that ends in noise, evaluations in one descent of a fit (those of a few
# parameters take 3 to 8), refits of one set from its own end. Halved, fits end above their minimum.
ITERATIONS = 15
# Second guesses: starts of a candidate, sets of a round that are fitted to their minimum, sets
# beside the best that are expanded, effects added beyond those dropped, rounds with free-form
# terms where something stays unexplained. Doubled, the search leaves deeper minima and takes four
# times as long.
SECOND_GUESSES = 2

# -- fits ------------------------------------------------------------------------------------

# Descents in one fit; the second begins with a Jacobian from differences. Steps that are tried from
# one point, each a quarter of the one before: a residual with a kink has no smaller ones. Doubled,
# kinks cost twice as much.
REPEATS = 3

# Chi-squared by which a fit may be above its minimum: little beside what tells two fits apart.
FIT_TOLERANCE = SAME * LEAST_SHARE**2
# EBIC above that of the best set from which on a set is out of the question: its chi-squared is
# larger than any saving in penalties.
OUT_OF_REACH = VERY_STRONG / LEAST_SHARE

# -- rounding --------------------------------------------------------------------------------

# Smallest share that is more than the rounding of sums of squares.
ROUNDING = 1e-9
# Variance of a number that may be anywhere in a range of width 1.
UNIFORM = 1 / 12
# Condition number of the normal matrix beyond which a combination of parameters is not
# identifiable: of the 16 digits of a number four are left.
MOST_CONDITION = 1e12
# Distance from the ends of a range, as a share of it, that is inside.
INTERIOR = 1e-6
# Smallest number, in place of 0, where a logarithm or a quotient is taken.
TINY = 1e-300
