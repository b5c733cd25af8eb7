"""Start values: which numbers do the records show before any simulation, and in which units is searched?"""
