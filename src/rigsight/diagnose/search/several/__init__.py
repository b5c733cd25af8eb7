"""Which effects together explain what a single one leaves? Grown one by one, then looked for anew from joint starts."""
