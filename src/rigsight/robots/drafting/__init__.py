"""How do the bodies, joints, actuators and sensors of a MuJoCo model become the tables of a rig file?"""
