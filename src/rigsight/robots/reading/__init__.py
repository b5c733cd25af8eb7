"""Content of a compiled MuJoCo model, and the parts that a rig file cannot represent."""
