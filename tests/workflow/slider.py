"""A rig file of a mass on a spring, whose numbers all have values."""

SLIDER = """
name = "slider"
summary = "A mass on a spring."
[inputs.force]
unit = "N"
[parameters.m]
unit = "kg"
default = 2.0
[parameters.k]
unit = "N/m"
default = 800.0
[parameters.d]
unit = "N s/m"
default = 5.0
[coordinates.x]
unit = "m"
[energy]
kinetic = "m*d(x)^2/2"
[joints.guide]
motion = "x"
stiffness = "k"
damping = "d"
[drives.motor]
signal = "force"
force = "motor"
along = "x"
[sensors.position]
reads = "x"
unit = "m"
"""
