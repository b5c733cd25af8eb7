"""Physical effects: one file per effect, each declared once as symbols."""

from rigsight.effects.catalogue import CATALOGUE as CATALOGUE
from rigsight.effects.catalogue import effect_named as effect_named
from rigsight.effects.catalogue import family_of as family_of
from rigsight.effects.effect import Effect as Effect
from rigsight.effects.effect import Energy as Energy
from rigsight.effects.effect import Family as Family
from rigsight.effects.effect import GainTrend as GainTrend
from rigsight.effects.effect import Place as Place
from rigsight.effects.effect import Signature as Signature
from rigsight.effects.effect import Start as Start
from rigsight.effects.effect import State as State
from rigsight.effects.effect import SumAndDifference as SumAndDifference
from rigsight.effects.placed import AT as AT
from rigsight.effects.placed import kind_of as kind_of
from rigsight.effects.placed import placed as placed
from rigsight.effects.placed import placed_dimension as placed_dimension
