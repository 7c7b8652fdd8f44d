"""What all laws agree on beside their functions: where a return ends, round-off, the cap of strength factors.

numba takes these as constants of kernels.
"""

# Where a return ended. TENSION: the tension cut-off acts, alone or together with other planes.
ELASTIC, FACE, EDGE, APEX_REGION, TENSION = range(5)

# A stress this little above strength, relative to its size, counts as admissible: some ten times the round-off that an
# eigen-solve and the rebuilding of a tensor leave, so that a returned stress is never returned again.
ADMISSIBLE_ROUND_OFF = 1e-13

STRENGTH_FACTOR_CAP = 10.0
