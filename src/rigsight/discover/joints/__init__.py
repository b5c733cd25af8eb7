"""Discovery on a rig of several joints: the missing force at each, and its law."""
