"""Level and power of the tests of a report's first page.

The page asks QUESTIONS: whether model and record differ in number, potency, b of potency, places and
directions. Each test has the level SIGNIFICANCE / QUESTIONS (Bonferroni), so that of the models that are right in all
of them a share of SIGNIFICANCE at most is said to differ in any.
"""

from scipy.special import ndtri

SIGNIFICANCE = 0.05  # Share of right models that a whole page calls wrong.
QUESTIONS = 5
TEST_LEVEL = SIGNIFICANCE / QUESTIONS
POWER = 0.8  # Share of differences that are noticed, of those named as noticeable.
# Standard errors that a difference needs beyond the limit of its test: a normal quantile.
POWER_DEVIATIONS = float(ndtri(POWER))
