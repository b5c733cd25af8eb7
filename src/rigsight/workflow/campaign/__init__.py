"""Campaigns and models: from files or memory to checked records and the given simulation; and drafts of new campaigns."""
