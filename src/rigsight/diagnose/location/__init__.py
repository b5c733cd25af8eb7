"""Location: in which records, bands, states and legs of the signal path is how much of the gap?"""
