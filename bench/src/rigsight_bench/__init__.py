"""Blind bench of rigsight: rigs whose effect is withheld are drawn, diagnosed in processes of their own, and scored."""
