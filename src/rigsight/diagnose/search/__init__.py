"""Which effects, alone and together, explain what the equations leave? Screened by place, then fitted."""
