"""How well are the numbers of a diagnosis known? A parametric bootstrap with a force from outside and with sensor noise."""
