"""Which model is the cause, with which probability, and what does it not explain?"""
