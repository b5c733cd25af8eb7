"""Fields of MuJoCo and Isaac Lab for the parameters and effects of a model."""
