"""Estimators of frequency responses and their noise."""

from rigsight.frequency.frequency_response import FrequencyResponse as FrequencyResponse
from rigsight.frequency.local_model import local_polynomial_response as local_polynomial_response
from rigsight.frequency.local_model import local_rational_response as local_rational_response
from rigsight.frequency.several_inputs import ResponsesOfInputs as ResponsesOfInputs
from rigsight.frequency.several_inputs import responses_of_inputs as responses_of_inputs
from rigsight.frequency.signal_pair import hold_response as hold_response
from rigsight.frequency.spectral import averaged_response as averaged_response
from rigsight.frequency.spectral import thesis_response as thesis_response
