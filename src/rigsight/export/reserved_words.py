"""Names that parameters, states and models cannot have, because several targets use them."""

from __future__ import annotations


def words(text: str) -> frozenset[str]:
    """Return the words of a text."""
    return frozenset(text.split())


_C = words(
    """auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while"""
)
_OF_TEMPLATES = words(
    """input_value input_rate input_curvature friction_sign sign_of rates switches outputs limits modes state math np control
    numbers given max min abs sign pi eps delay"""
)
_C_MACROS = words(
    """BUFSIZ EOF EXIT_FAILURE EXIT_SUCCESS EXPORTED FILENAME_MAX FOPEN_MAX FP_INFINITE FP_NAN FP_NORMAL FP_SUBNORMAL FP_ZERO
    HUGE_VAL HUGE_VALF HUGE_VALL INFINITY L_tmpnam MATH_ERREXCEPT MATH_ERRNO NAN NULL RAND_MAX SEEK_CUR SEEK_END SEEK_SET
    TMP_MAX bool linux math_errhandling stderr stdin stdout unix
    DEPENDENT_MODES DIFFERENCE HAS_DELAY HAS_LIMITS LEAST_DIFFERENCE MAX_STEPS MOST_DEFECT OFTEN RARE ROLLED SHORTEST_DEFECT
    N_COMPUTED N_DEPENDENT N_IN N_INPUTS N_MODES N_OUT N_PARAMETERS N_SLOPES N_STATES N_UNKNOWN N_VALUES N_WATCHED ROUNDING
    SIZE_CONSTANTS SIZE_INPUTS SIZE_MODES SIZE_STATES SIZE_WATCHED VELOCITY AGREED FRICTION_IS_SHOWN FRICTION_MODES
    FRICTION_VELOCITIES GENERATIONS INDEPENDENT MOST_REPEATS NOISE N_DEGREES N_FRICTIONS N_LATE PROBE READS_LATE_RATE
    SIZE_FRICTIONS"""
)
SHARED = _C | _C_MACROS | _OF_TEMPLATES
"""What the text of the engine and the templates use; the words of a language stand in the module that writes it."""
