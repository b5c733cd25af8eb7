"""Report of a blind bench: words, figures, page, text."""
