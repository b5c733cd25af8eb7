"""What counts as noise and disturbance, and what does a model leave above them?"""
