"""What each command does, from a campaign to results on disk; callable from a notebook."""
