"""Which effects, alone and together, explain the residual of the equations? They are screened by place and then fitted."""
