"""Comparison of many models on many records: frequency responses, steps and free runs, each with its noise floor."""

from rigsight.compare.comparison import QUANTITIES as QUANTITIES
from rigsight.compare.comparison import Column as Column
from rigsight.compare.comparison import Comparison as Comparison
from rigsight.compare.comparison import Competitor as Competitor
from rigsight.compare.comparison import Failure as Failure
from rigsight.compare.comparison import Floor as Floor
from rigsight.compare.comparison import RecordComparison as RecordComparison
from rigsight.compare.comparison import Score as Score
from rigsight.compare.on_one_record import Yardstick as Yardstick
from rigsight.compare.on_one_record import compare_on_record as compare_on_record
from rigsight.compare.on_one_record import free_run as free_run
from rigsight.compare.own_numbers import NumberCheck as NumberCheck
from rigsight.compare.own_numbers import OwnNumber as OwnNumber
from rigsight.compare.own_numbers import Suspect as Suspect
from rigsight.compare.own_numbers import check_numbers as check_numbers
from rigsight.compare.own_numbers import own_numbers as own_numbers
from rigsight.compare.own_numbers import suspects as suspects
from rigsight.compare.response_error import ResponseError as ResponseError
from rigsight.compare.response_error import SignalPath as SignalPath
from rigsight.compare.response_error import StepWindow as StepWindow
from rigsight.compare.response_error import response_error as response_error
from rigsight.compare.response_error import response_floor as response_floor
from rigsight.compare.response_error import signal_paths as signal_paths
from rigsight.compare.response_error import step_window as step_window
from rigsight.compare.usual_gap import KnownGap as KnownGap
from rigsight.compare.usual_gap import UsualGap as UsualGap
