"""Trials as laboratories measure: filters, feedback, stiction, encoders, decays, drift, offsets, and several causes at once."""
