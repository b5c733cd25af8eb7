"""Which names can no parameter, state or model have, because a language or a template uses them itself?"""

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
    """input_value input_rate friction_sign sign_of rates switches outputs limits modes state math np control numbers given
    max min abs sign pi eps delay"""
)
RESERVED = C | MATLAB | MODELICA | _OF_TEMPLATES | frozenset(keyword.kwlist)
"""A name inside an export is none of these, so that it is the same in all of them."""
