"""Which experiment separates the rivals that the records leave?"""

from rigsight.plan.experiments import Limit as Limit
from rigsight.plan.experiments import use_of as use_of
from rigsight.plan.planning import Sizes as Sizes
from rigsight.plan.rivals import Named as Named
