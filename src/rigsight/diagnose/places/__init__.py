"""Places: at which joint, drive or sensor does a gap arise, before it is asked which effect causes it?"""
