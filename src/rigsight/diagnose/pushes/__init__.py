"""How do the readings of fitted equations answer to a small push at a place?"""
