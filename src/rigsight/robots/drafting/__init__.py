"""Bodies, joints, actuators and sensors of a MuJoCo model as tables of a rig file."""
