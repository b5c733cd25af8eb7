"""Several effects: they are added one by one, then pairs are also fitted from joint starts."""
