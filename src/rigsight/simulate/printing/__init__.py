"""How are the equations of a structure written in each language? One file per language, and what they share."""
