"""From a rig file to a rig: tables, expressions, units, names, checked before anything is built."""
