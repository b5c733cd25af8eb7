"""Names that parameters, states and models cannot have, because a language or a template uses them."""

from __future__ import annotations

import keyword


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


C = _words(
    """auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while"""
)
MATLAB = _words(
    """break case catch classdef continue else elseif end for function global if otherwise parfor persistent return spmd
    switch try while"""
)
MODELICA = _words(
    """algorithm and annotation block break class connect connector constant constrainedby der discrete each else elseif
    elsewhen encapsulated end enumeration equation expandable extends external false final flow for function if import in
    initial inner input loop model not operator or outer output package parameter partial protected public pure record
    redeclare replaceable return stream then time true type when while within"""
)
_OF_TEMPLATES = _words(
    """input_value input_rate input_curvature friction_sign sign_of rates switches outputs limits modes state math np control
    numbers given max min abs sign pi eps delay"""
)
_C_MACROS = _words(
    """BUFSIZ EOF EXIT_FAILURE EXIT_SUCCESS EXPORTED FILENAME_MAX FOPEN_MAX FP_INFINITE FP_NAN FP_NORMAL FP_SUBNORMAL FP_ZERO
    HUGE_VAL HUGE_VALF HUGE_VALL INFINITY L_tmpnam MATH_ERREXCEPT MATH_ERRNO NAN NULL RAND_MAX SEEK_CUR SEEK_END SEEK_SET
    TMP_MAX bool linux math_errhandling stderr stdin stdout unix
    DEPENDENT_MODES DIFFERENCE HAS_DELAY HAS_LIMITS LEAST_DIFFERENCE MAX_STEPS MOST_DEFECT OFTEN RARE ROLLED SHORTEST_DEFECT
    N_COMPUTED N_DEPENDENT N_IN N_INPUTS N_MODES N_OUT N_PARAMETERS N_SLOPES N_STATES N_UNKNOWN N_VALUES N_WATCHED ROUNDING
    SIZE_CONSTANTS SIZE_INPUTS SIZE_MODES SIZE_STATES SIZE_WATCHED VELOCITY AGREED FRICTION_IS_SHOWN FRICTION_MODES
    FRICTION_VELOCITIES GENERATIONS INDEPENDENT MOST_REPEATS NOISE N_DEGREES N_FRICTIONS N_LATE PROBE READS_LATE_RATE
    SIZE_FRICTIONS"""
)
RESERVED = C | _C_MACROS | MATLAB | MODELICA | _OF_TEMPLATES | frozenset(keyword.kwlist)
"""A name inside an export is none of these, so that it is the same in all of them."""
