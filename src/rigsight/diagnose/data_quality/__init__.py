"""Can the records be trusted, before any effect is blamed?"""
