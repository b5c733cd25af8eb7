"""Trials whose plants are a second source: equations of motion and effects written out by hand, composed from no declaration."""
