"""Which experiment separates the rivals that the records leave?"""

from rigsight.plan.experiments import Limit as Limit
from rigsight.plan.experiments import read_limits as read_limits
from rigsight.plan.experiments import read_payloads as read_payloads
from rigsight.plan.experiments import use_of as use_of
from rigsight.plan.planning import Plan as Plan
from rigsight.plan.planning import Sizes as Sizes
from rigsight.plan.planning import plan_experiment as plan_experiment
from rigsight.plan.rivals import Named as Named
