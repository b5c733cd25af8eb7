"""Which kinds of numbers do effects have? What a kind says of all its numbers stands here; a `Parameter` says all itself."""

from __future__ import annotations

from functools import partial

from rigsight.parameters import Parameter

amount = partial(Parameter, lower=0.0, null=0.0)
"""Never negative; at 0 its effect vanishes."""
signed = partial(Parameter, null=0.0)
"""Of either sign; at 0 its effect vanishes."""
limit = partial(Parameter, upper=1e300, null=1e300)
"""Where something ends; its effect vanishes where that is beyond all that occurs."""
scale = partial(Parameter, logarithmic=True)
"""A positive size, searched over decades, at no value of which its effect vanishes."""
