"""Where the gap between simulation and rig lies, which effect causes it, how far it shrinks."""
