"""Candidates: each effect at each place, alone and in pairs, fitted to the records and scored."""
