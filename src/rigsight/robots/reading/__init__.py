"""What does a compiled MuJoCo model hold, and what of it can a rig file not say?"""
