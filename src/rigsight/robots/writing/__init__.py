"""Which fields of MuJoCo and Isaac Lab say the numbers and effects of a model?"""
