"""Which model is the cause, how surely, and what does it still leave?"""
