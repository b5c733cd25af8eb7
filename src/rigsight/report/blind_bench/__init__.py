"""The score of a blind bench for people: words, figures, page, text."""
