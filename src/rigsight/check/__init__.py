"""What records can show before anything is fitted: their channels, the parameters, and which effects can be told apart."""

from rigsight.check.campaign_check import Check as Check
from rigsight.check.channels import Channel as Channel
from rigsight.check.channels import CheckedRecord as CheckedRecord
from rigsight.check.effect_matrix import Told as Told
from rigsight.check.effect_matrix import Visible as Visible
from rigsight.check.effect_matrix import holes_of as holes_of
from rigsight.check.remarks import Remark as Remark
