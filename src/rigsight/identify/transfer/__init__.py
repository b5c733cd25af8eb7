"""Transfer functions: which PT1 or PT2 does a record show, and which physical parameters does it stand for?"""
