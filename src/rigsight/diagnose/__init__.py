"""Where the gap between simulation and rig lies, which effect causes it, how far it shrinks."""

from rigsight.diagnose.diagnosis import diagnose as diagnose
from rigsight.diagnose.fit_context import candidates_on as candidates_on
from rigsight.diagnose.fit_context import structures_to_fit as structures_to_fit
from rigsight.diagnose.result import Candidate as Candidate
from rigsight.diagnose.result import Diagnosis as Diagnosis
from rigsight.diagnose.result import LikelyCauses as LikelyCauses
from rigsight.diagnose.search.screening import structures_of_shortlist as structures_of_shortlist
from rigsight.diagnose.verdict.calibration import Calibration as Calibration
from rigsight.diagnose.verdict.calibration import Situation as Situation
from rigsight.diagnose.verdict.judgement import Verdict as Verdict
