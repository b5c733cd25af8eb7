"""Output-error fits: which numbers make a simulation follow its records, and how sure are they?"""
