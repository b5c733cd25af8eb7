"""Scores of trials whose truth is known, single and summarized."""
