"""Trust in the parameters of the diagnosed model: estimated again by record, amplitude, constant and window.
"""
